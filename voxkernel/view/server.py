"""Serve a viewer on loopback until an interrupt: a free port, an address that others on the machine do not know."""

from __future__ import annotations

import contextlib
import os
import secrets
import signal
import sys
import webbrowser
from collections.abc import Callable, Generator
from functools import partial
from pathlib import Path
from typing import Any

from voxkernel._extras import optional
from voxkernel.view.desk import Desk
from voxkernel.view.loopback import HOST
from voxkernel.view.shown import Shown

__all__ = ["serve"]


def serve(
    shown: Shown, *, port: int = 0, browser: bool = True, ready: Callable[[str], None] | None = None,
    until: Callable[[], Any] | None = None,
) -> None:  # fmt: skip
    """Serve until `until()`, awaited, is done, or until an interrupt, which is raised again once all is closed.

    `ready` is called with the address as soon as it answers; `port` 0 takes a free one.
    """
    get_server = optional("trame.app").get_server
    optional("trame_vtk")
    import asyncio

    server = get_server(f"voxkernel-{secrets.token_hex(4)}")
    desk = Desk(server, shown)
    try:
        interrupted = asyncio.run(_run(server, port, browser, ready, until))
    finally:
        desk.close()
    if interrupted:
        raise KeyboardInterrupt


async def _run(server: Any, port: int, browser: bool, ready: Any, until: Any) -> bool:
    """Serve; whether it was an interrupt that ended it."""
    import asyncio

    interrupt = _interrupts()

    password, token = secrets.token_urlsafe(24), secrets.token_urlsafe(24)
    routes = partial(_add_routes, port=lambda: server.port, password=password, token=token)
    server.controller.add("on_server_bind")(routes)
    is_up = server.ready
    with _own_arguments(password):
        running = asyncio.ensure_future(
            server.start(
                port=port, host=HOST, exec_mode="coroutine", thread=True, timeout=0, open_browser=False,
                show_connection_info=False, disable_logging=True,
            )
        )  # fmt: skip
    try:
        await asyncio.wait({running, is_up}, return_when=asyncio.FIRST_COMPLETED)
        if running.done():
            running.result()  # as a port that is taken: it raises
        address = f"http://{HOST}:{server.port}/{token}/"
        if ready is not None:
            ready(address)
        if browser:
            webbrowser.open(address)
        ends = {running, asyncio.ensure_future(interrupt.wait())}
        if until is not None:
            ends.add(asyncio.ensure_future(until()))
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        return interrupt.is_set()
    finally:
        if not running.done():
            await server.stop()
            await asyncio.wait({running}, timeout=2.0)


def _interrupts() -> Any:
    """An event that Ctrl-C and SIGTERM set, so that nothing is torn down halfway; those that are ignored stay so."""
    import asyncio

    event, loop = asyncio.Event(), asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) != signal.SIG_IGN:
            with contextlib.suppress(NotImplementedError, ValueError, RuntimeError):  # Windows, or another thread
                loop.add_signal_handler(number, event.set)
    return event


def _add_routes(bound: Any, port: Callable[[], int], password: str, token: str) -> None:
    """The page lies in a folder that only the address names, and finds the password of its socket there."""
    web: Any = optional("aiohttp.web")
    index = Path(optional("trame_client.module.vue3").www) / "index.html"

    async def page(_: Any) -> Any:
        return web.FileResponse(index)

    async def told(_: Any) -> Any:
        return web.json_response({"sessionURL": f"ws://{HOST}:{port()}/ws", "secret": password})

    async def elsewhere(request: Any) -> Any:  # programs are no secret
        raise web.HTTPFound(f"/{request.match_info['rest']}")

    async def nothing(_: Any) -> Any:
        return web.Response(status=204)

    bound.app.add_routes(
        [
            web.get(f"/{token}/", page), web.post(f"/{token}/paraview/", told),
            web.get(f"/{token}/{{rest:.+}}", elsewhere), web.get("/favicon.ico", nothing),
        ]
    )  # fmt: skip


@contextlib.contextmanager
def _own_arguments(password: str) -> Generator[None]:
    """Trame reads its options from the command line; give it its password there, and keep its word off stdout."""
    before = sys.argv
    sys.argv = [before[0] if before else "", "--authKey", password]
    os.environ["WSLINK_READY_MSG"] = ""
    try:
        yield
    finally:
        sys.argv = before
