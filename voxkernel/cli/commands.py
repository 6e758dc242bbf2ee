"""Parse the arguments, run one command, turn known errors into one line.

A command is a module of this package with `HELP`, `DESCRIPTION`, `EXAMPLES`, `add_arguments(parser)`
and `run(args) -> exit code`, named in `COMMANDS`. It imports nothing heavy before `run`.
"""

from __future__ import annotations

import argparse
import logging
import os
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

from voxkernel._version import __version__
from voxkernel.cli.argument_types import joined
from voxkernel.cli.input_globs import expand_globs
from voxkernel.cli.messages import did_you_mean, option_names, spoken
from voxkernel.cli.output import UsageError, report_error
from voxkernel.cli.stages import stages
from voxkernel.errors import VoxKernelError

__all__ = ["COMMANDS", "parsed", "parser", "run"]

COMMANDS = (
    *("kernel", "center", "score", "guards", "sphere", "register", "labels", "evaluate", "report", "info", "repair"),
    *("view", "demo"),
)
_FAILED, _BAD_USAGE = 1, 2


class _Parser(argparse.ArgumentParser):
    """Report bad usage in one line, with a guess at what was meant."""

    def error(self, message: str) -> NoReturn:
        report_error(f"{did_you_mean(message, option_names(self).values())} (see `{self.prog} --help`)")
        sys.exit(_BAD_USAGE)


def parsed(argv: Sequence[str] | None) -> argparse.Namespace:
    """Parse the arguments and set up messages."""
    _accept_any_text()
    args, left = parser().parse_known_args(joined(sys.argv[1:] if argv is None else argv))
    if left:
        args.parser.error(f"unrecognized arguments: {' '.join(left)}")
    if args.verbose:
        logging.basicConfig(stream=sys.stderr, level=logging.DEBUG if args.verbose > 1 else logging.INFO)
    else:
        warnings.simplefilter("ignore")
    return args


def run(args: argparse.Namespace) -> int:
    """Run the command that the arguments name, and give its exit code."""
    names = option_names(args.parser)
    try:
        expand_globs(args)
        args.stage = stages(quiet=args.quiet)
        code = int(import_module(f"voxkernel.cli.{args.command}").run(args))
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        # The reader has gone (`| head`): nothing is left to say, not even at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _FAILED
    except UsageError as error:
        report_error(f"{spoken(str(error), names)} (see `voxkernel {args.command} --help`)")
        return _BAD_USAGE
    except (VoxKernelError, OSError, ValueError, MemoryError) as error:
        if args.verbose:
            raise
        report_error(spoken(str(error), names) or type(error).__name__)
        return _FAILED


def parser() -> argparse.ArgumentParser:
    """Make the parser of all commands."""
    common = _Parser(add_help=False)
    group = common.add_argument_group("messages")
    group.add_argument(
        "-v", "--verbose", action="count", default=argparse.SUPPRESS, help="show log, warnings and tracebacks"
    )
    group.add_argument(
        "-q", "--quiet", action="store_true", default=argparse.SUPPRESS, help="no messages but errors on stderr"
    )
    whole = _Parser(
        prog="voxkernel",
        description="The surface kernel of 3D shapes: the points from which the whole surface can be seen.",
        epilog="`voxkernel COMMAND --help` shows examples. Start with `voxkernel demo`.",
        parents=[common],
    )
    whole.add_argument("--version", action="version", version=f"voxkernel {__version__}")
    commands = whole.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        module = import_module(f"voxkernel.cli.{name}")
        sub = commands.add_parser(
            name, help=module.HELP, description=module.DESCRIPTION, parents=[common],
            epilog="examples:\n" + "\n".join(f"  {line}" for line in module.EXAMPLES),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )  # fmt: skip
        module.add_arguments(sub)
        sub.set_defaults(parser=sub)
    whole.set_defaults(verbose=0, quiet=False)
    return whole


def _accept_any_text() -> None:
    """Let file names with bytes that are no text in this locale be printed, escaped, instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")
