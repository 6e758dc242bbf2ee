"""The program that reads files with PyMeshLab for another process: `other_formats.py` starts it and says what to read.

It is run as a script in a fresh interpreter and imports nothing of this package. Each line of standard input is a
request in JSON; standard output gets a line of JSON for each, and behind it the arrays.
"""

import contextlib
import importlib
import json
import os
import signal
import sys
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]


def main() -> None:
    """Serve requests until there are no more."""
    requests, answers = sys.stdin.buffer, _own_output()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent is interrupted, and ends this process
    _no_crash_reports()
    given = _soft_limits()
    for line in requests:
        request = json.loads(line)
        try:
            pymeshlab: Any = importlib.import_module("pymeshlab")
            _limit(request["memory"], request["seconds"], given)
            answer = _read(pymeshlab, request["file"])
        except Exception as error:  # whatever the library raises is an answer, not the end
            _send(answers, {"error": f"{type(error).__name__}: {error}".split("Error details:")[-1]})
        else:
            _send(answers, {"n_vertices": len(answer[0]), "n_faces": len(answer[1])}, *answer)


def _own_output() -> BinaryIO:
    """Standard output for the answers alone: what libraries print goes nowhere."""
    own = os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    return own


def _no_crash_reports() -> None:
    """A death leaves no core file and no window."""
    if sys.platform == "win32":
        import ctypes

        ctypes.windll.kernel32.SetErrorMode(0x0001 | 0x0002)  # fail critical errors, no box for faults
    else:
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))


def _soft_limits() -> dict[int, int]:
    """Limits of addresses and processor time that this process was started with; the system may know none."""
    if sys.platform == "win32":
        return {}
    import resource

    kinds = [resource.RLIMIT_CPU] + [resource.RLIMIT_AS] * (sys.platform == "linux")
    return {kind: resource.getrlimit(kind)[0] for kind in kinds}


def _limit(memory: int, seconds: int, given: dict[int, int]) -> None:
    """Bound addresses and processor time of what comes, never above the limits given from outside."""
    if sys.platform == "win32":
        return
    import resource

    usage = resource.getrusage(resource.RUSAGE_SELF)
    most = {resource.RLIMIT_CPU: int(usage.ru_utime + usage.ru_stime) + 1 + seconds}
    if resource.RLIMIT_AS in given:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most[resource.RLIMIT_AS] = pages * resource.getpagesize() + memory
    for kind, soft in given.items():
        lower = most[kind] if soft == resource.RLIM_INFINITY else min(soft, most[kind])
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(kind, (lower, resource.getrlimit(kind)[1]))


def _read(pymeshlab: Any, file: str) -> Arrays:
    """All layers of the file in one surface, each moved by its own matrix."""
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(file)
    vertices: list[NDArray[np.float64]] = [np.zeros((0, 3))]
    faces: list[NDArray[np.int64]] = [np.zeros((0, 3), dtype=np.int64)]
    n = 0
    for mesh in meshes:
        points = np.array(mesh.vertex_matrix(), dtype=np.float64).reshape(-1, 3)
        triangles = np.array(mesh.face_matrix(), dtype=np.int64).reshape(-1, 3)
        matrix = np.array(mesh.transform_matrix(), dtype=np.float64)
        if not np.array_equal(matrix, np.eye(4)):
            points = points @ matrix[:3, :3].T + matrix[:3, 3]
            if np.linalg.det(matrix[:3, :3]) < 0.0:
                triangles = triangles[:, ::-1]
        vertices.append(points)
        faces.append(triangles + n)
        n += len(points)
    return np.concatenate(vertices), np.concatenate(faces)


def _send(answers: BinaryIO, head: dict[str, Any], *arrays: NDArray[Any]) -> None:
    answers.write(json.dumps(head).encode() + b"\n")
    for array in arrays:
        answers.write(np.ascontiguousarray(array).tobytes())
    answers.flush()


if __name__ == "__main__":
    main()
