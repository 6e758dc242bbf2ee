"""Where a viewer is served: on this machine only."""

from __future__ import annotations

import os
import socket

from voxkernel._checks import as_depth

__all__ = ["HOST", "free_port"]

HOST = "127.0.0.1"


def free_port(port: object) -> int:
    """Check a port before long work; 0 stands for any that is free when the server starts."""
    number = as_depth("port", port, 0, 65535)
    with socket.socket() as trial:
        if os.name == "posix":  # as the server will: a port that was just left is free
            trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((HOST, number))
        except OSError as error:
            raise ValueError(f"`port` must be free; got {number}: {error.strerror}") from None
    return number
