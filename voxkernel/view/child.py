"""The process of a viewer: what is shown comes by stdin, the address goes to stdout, its end is the end."""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading

from voxkernel.view.server import serve

__all__ = ["main"]


def main() -> None:
    """Serve until stdin is closed; an interrupt of the terminal is for the parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    port, browser = (int(word) for word in sys.argv[1:3])
    shown = pickle.load(sys.stdin.buffer)
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # whatever else is printed does not mix with the address
    try:
        serve(shown, port=port, browser=bool(browser), ready=lambda url: print(url, file=out, flush=True), until=_end)
    except OSError as error:
        print(error, file=out, flush=True)
        sys.exit(1)


async def _end() -> None:
    """Wait for the end of stdin, without keeping a thread that the end of the process would have to join."""
    import asyncio

    loop, over = asyncio.get_running_loop(), asyncio.Event()

    def wait() -> None:
        while os.read(0, 4096):
            pass
        loop.call_soon_threadsafe(over.set)

    threading.Thread(target=wait, daemon=True).start()
    await over.wait()
