"""Files read by PyMeshLab, in a process of its own: damaged ones end that process and not this one."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Event, Thread
from typing import Any, Self
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import check_installed
from voxkernel.errors import MeshReadError

__all__ = ["MeshlabReader", "read_with_meshlab"]

# Limits of one file: far above what sound files took, so that they only end what would never end.
_MEMORY, _MEMORY_PER_BYTE = 2**30, 128
_SECONDS, _SECONDS_PER_BYTE = 60, 2e-5
_WALL_SECONDS, _WALL_FACTOR = 300, 5
# A child that uses no processor time for so long waits for something that never comes: a damaged file can bring the
# threads of the library to wait for each other.
_ASLEEP_SECONDS = 30
_PROGRAM = Path(__file__).with_name("meshlab_child.py")
# The child finds the modules that this process finds; `-P` alone keeps those of this folder from hiding others.
_START = "import json, runpy, sys; sys.path[:] = json.loads(sys.argv[1]); runpy.run_path(sys.argv[2], None, '__main__')"
_MOST_TEXT = 1 << 16


def read_with_meshlab(file: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Vertices and triangles of a file; every failure is a MeshReadError of one line that names the file."""
    with MeshlabReader() as reader:
        return reader.read(file)


class MeshlabReader:
    """A child process that reads one file after the other; a new one is started where one has died.

    Parameters
    ----------
    seconds : int, optional
        Processor time a file may take, instead of a time by its size.
    """

    def __init__(self, *, seconds: int | None = None) -> None:
        self._seconds = seconds
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the child; it has nothing to save."""
        process, self._process = self._process, None
        if process is not None:
            with process:  # closes the pipes and waits
                process.kill()

    def read(self, file: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Vertices and triangles of a file, as the child gives them: their values are not checked."""
        size = _size_with_parts(file)
        seconds = self._seconds or _SECONDS + int(size * _SECONDS_PER_BYTE)
        request = {
            "file": os.path.abspath(file),  # Path.resolve follows links, but parts lie beside the link
            "memory": _MEMORY + _MEMORY_PER_BYTE * size,
            "seconds": seconds,
        }
        limit = _WALL_SECONDS + _WALL_FACTOR * seconds
        process = self._process = self._process or _start(file)
        watch = _Watch(process, limit)
        try:
            return _ask(process, request)
        except _Refused as error:
            raise MeshReadError(f"'{file}' is not a readable {file.suffix.lower()} file: {error}") from error
        except (OSError, EOFError, ValueError, KeyError, TypeError, MemoryError) as error:
            self.close()
            end = watch.reason or _end_of(process.returncode, seconds, error)
            raise MeshReadError(f"'{file}' cannot be read: {end}") from error
        except BaseException:  # an interrupt: the next answer would be that of this file
            self.close()
            raise
        finally:
            watch.over.set()


class _Watch:
    """A thread that kills a child after `limit` seconds, or when it has slept for too long; `reason` says which."""

    def __init__(self, process: subprocess.Popen[bytes], limit: float) -> None:
        self.over = Event()
        self.reason = ""
        Thread(target=self._run, args=(process, limit), daemon=True).start()

    def _run(self, process: subprocess.Popen[bytes], limit: float) -> None:
        start = awake = time.monotonic()
        used = _processor_ticks(process.pid)
        while not self.over.wait(max(0.0, min(1.0, start + limit - time.monotonic()))):
            now, ticks = time.monotonic(), _processor_ticks(process.pid)
            if ticks is None or ticks != used:
                awake, used = now, ticks
            if now - start >= limit:
                self.reason = f"PyMeshLab took more than {limit} s"
            elif now - awake >= _ASLEEP_SECONDS:
                self.reason = f"PyMeshLab did nothing for {_ASLEEP_SECONDS} s"
            if self.reason:
                process.kill()
                return


def _processor_ticks(pid: int) -> int | None:
    """Processor time a process has used; None where the system does not tell."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return int(fields[11]) + int(fields[12])
    except (OSError, ValueError, IndexError):
        return None


class _Refused(Exception):
    """The library says in words that it cannot read the file."""


def _start(file: Path) -> subprocess.Popen[bytes]:
    check_installed("pymeshlab")
    program = sys.executable
    if not program or getattr(sys, "frozen", False):
        raise MeshReadError(
            f"'{file}' must be read by PyMeshLab in a Python interpreter of its own; got a program without one "
            "(convert it to .ply first)"
        )
    return subprocess.Popen(
        [program, "-P", "-c", _START, json.dumps(sys.path), str(_PROGRAM)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
    )


def _ask(process: subprocess.Popen[bytes], request: dict[str, Any]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(json.dumps(request).encode() + b"\n")
    process.stdin.flush()
    line = process.stdout.readline(_MOST_TEXT)
    if not line.endswith(b"\n"):
        raise EOFError
    head = json.loads(line)
    if "error" in head:
        raise _Refused(" ".join(head["error"].split())[:300])
    vertices, faces = np.empty((head["n_vertices"], 3)), np.empty((head["n_faces"], 3), dtype=np.int64)
    for array in (vertices, faces):
        data = process.stdout.read(array.nbytes)
        if len(data) < array.nbytes:
            raise EOFError
        array.reshape(-1)[:] = np.frombuffer(data, array.dtype)
    return vertices, faces


def _end_of(code: int, seconds: int, error: Exception) -> str:
    """What happened to the child, in words."""
    if isinstance(error, MemoryError):
        return "it is too large for the memory"
    if not isinstance(error, EOFError | OSError):
        return "PyMeshLab gave no sensible answer"
    if code >= 0:
        return f"PyMeshLab ended with exit code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    if name == "SIGXCPU":
        return f"PyMeshLab took more than {seconds} s of processor time"
    return f"PyMeshLab died of {name}"


def _size_with_parts(file: Path) -> int:
    """Bytes of the file and of those that a .gltf file names; what cannot be read is left to the library to tell."""
    if file.suffix.lower() != ".gltf":
        return file.stat().st_size
    text = b""
    with contextlib.suppress(OSError):
        text = file.read_bytes()
    names = {unquote(os.fsdecode(name)) for name in re.findall(rb'"uri"\s*:\s*"([^"]{1,255})"', text)}
    parts = [os.path.join(file.parent, name) for name in names if not name.startswith("data:")]
    return len(text) + sum(os.path.getsize(part) for part in parts if os.path.isfile(part))
