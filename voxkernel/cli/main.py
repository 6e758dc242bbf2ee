"""`voxkernel`: parse the arguments, run one command, turn known errors into one line.

A command is a module of this package with `HELP`, `DESCRIPTION`, `EXAMPLES`, `add_arguments(parser)`
and `run(args) -> exit code`, named in `COMMANDS`. It imports nothing heavy before `run`.
"""

from __future__ import annotations

import argparse
import logging
import os
import signal
import sys
import threading
import warnings
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import NoReturn

from voxkernel._version import __version__
from voxkernel.cli.output import UsageError, report_error
from voxkernel.errors import VoxKernelError

__all__ = ["COMMANDS", "main"]

COMMANDS = ("kernel", "center", "score", "sphere", "register", "evaluate", "report", "info", "demo")
_OK, _FAILED, _BAD_USAGE, _INTERRUPTED = 0, 1, 2, 130


class _Parser(argparse.ArgumentParser):
    """Report bad usage in one line."""

    def error(self, message: str) -> NoReturn:
        report_error(f"{message} (see `{self.prog} --help`)")
        sys.exit(_BAD_USAGE)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments without the program's name; those of the process by default.

    Returns
    -------
    int
        0 ok, 1 some items failed, 2 bad usage, 130 interrupted (Ctrl-C, SIGTERM).

    Examples
    --------
    >>> main(["score", "no-such-mesh.ply", "--quiet"])  # doctest: +ELLIPSIS
    no-such-mesh.ply  failed...
    1
    """
    try:
        with _termination_as_interrupt():
            return _run(argv)
    except KeyboardInterrupt:
        report_error("interrupted")
        return _INTERRUPTED


def _run(argv: Sequence[str] | None) -> int:
    """Parse the arguments and run the command they name."""
    _accept_any_text()
    args = _parser().parse_args(argv)
    if args.verbose:
        logging.basicConfig(stream=sys.stderr, level=logging.DEBUG if args.verbose > 1 else logging.INFO)
    else:
        warnings.simplefilter("ignore")
    try:
        code = int(import_module(f"voxkernel.cli.{args.command}").run(args))
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        # The reader has gone (`| head`): nothing is left to say, not even at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return _FAILED
    except UsageError as error:
        report_error(f"{error} (see `voxkernel {args.command} --help`)")
        return _BAD_USAGE
    except (VoxKernelError, OSError, ValueError, MemoryError) as error:
        if args.verbose:
            raise
        report_error(str(error) or type(error).__name__)
        return _FAILED


@contextmanager
def _termination_as_interrupt() -> Generator[None]:
    """Let SIGTERM, which job schedulers and `timeout` send, end a command in order, as Ctrl-C does."""
    in_main = threading.current_thread() is threading.main_thread()  # others cannot set handlers
    is_ours = in_main and signal.getsignal(signal.SIGTERM) == signal.SIG_DFL
    if is_ours:
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        if is_ours:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _parser() -> argparse.ArgumentParser:
    common = _Parser(add_help=False)
    group = common.add_argument_group("messages")
    group.add_argument(
        "-v", "--verbose", action="count", default=argparse.SUPPRESS, help="show log, warnings and tracebacks"
    )
    group.add_argument(
        "-q", "--quiet", action="store_true", default=argparse.SUPPRESS, help="no messages but errors on stderr"
    )
    parser = _Parser(
        prog="voxkernel",
        description="The surface kernel of 3D shapes: the points from which the whole surface can be seen.",
        epilog="`voxkernel COMMAND --help` shows examples. Start with `voxkernel demo`.",
        parents=[common],
    )
    parser.add_argument("--version", action="version", version=f"voxkernel {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        module = import_module(f"voxkernel.cli.{name}")
        sub = commands.add_parser(
            name, help=module.HELP, description=module.DESCRIPTION, parents=[common],
            epilog="examples:\n" + "\n".join(f"  {line}" for line in module.EXAMPLES),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )  # fmt: skip
        module.add_arguments(sub)
    parser.set_defaults(verbose=0, quiet=False)
    return parser


def _accept_any_text() -> None:
    """Let file names with bytes that are no text in this locale be printed, escaped, instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")


if __name__ == "__main__":
    sys.exit(main())
