"""A client of a Dask scheduler that runs elsewhere, and how to wait for what its workers return."""

from typing import Any

from voxkernel._extras import optional

__all__ = ["client_of", "result_of"]


def client_of(scheduler: str) -> Any:
    """Connect to the scheduler at an address.

    Raises
    ------
    ValueError
        If there is none; in one line.
    """
    distributed = optional("distributed")
    try:
        # A client that cannot read its address does not end in order.
        optional("distributed.comm.addressing").get_address_host(scheduler)
        return distributed.Client(scheduler, timeout="5s", set_as_default=False)
    except (OSError, ValueError) as error:
        wrong = f"`scheduler` must be the address of a scheduler; got {scheduler!r}"
        raise ValueError(f"{wrong} ({' '.join(str(error).split())})") from None


def result_of(client: Any, future: Any, *, timeout: float | None = None) -> Any:
    """Give what a task has returned, or raise what it has raised.

    `Future.result` of Dask, interrupted, cancels its own waiting halfway and writes on stderr what that leaves
    behind. Here only the caller stops waiting.
    """
    import asyncio

    waiting = client.gather(future, asynchronous=True)
    return asyncio.run_coroutine_threadsafe(waiting, client.loop.asyncio_loop).result(timeout)
