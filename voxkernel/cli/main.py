"""`voxkernel`: the way in. An interrupt is one line and exit code 130 from `main` on, so all else is imported later."""

import os
import signal
import sys

TYPE_CHECKING = False  # from `typing`, which would have to be imported
if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import FrameType

__all__ = ["main"]

_INTERRUPTED = 130
_TEXT = b"voxkernel: error: interrupted\n"


def main(argv: "Sequence[str] | None" = None) -> int:
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
    # Those that the caller ignores or handles itself stay as they are.
    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    ours = [number for number, handler in usual.items() if signal.getsignal(number) == handler]
    try:
        for number in ours:
            signal.signal(number, signal.default_int_handler if argv is not None else _leave)
    except ValueError:  # only the main thread can
        ours = []
    try:
        from voxkernel.cli.commands import parsed, run

        args = parsed(argv)
        for number in ours:
            signal.signal(number, signal.default_int_handler)
        return run(args)
    except KeyboardInterrupt:
        os.write(2, _TEXT)
        return _INTERRUPTED
    finally:
        for number in ours:
            signal.signal(number, usual[number])


def _leave(number: int, frame: "FrameType | None") -> None:
    """End at once: nothing has begun, and an exception raised within an import may be lost there."""
    os.write(2, _TEXT)
    os._exit(_INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())
