"""`exact_kernel` on one and two threads, and the memory it takes beyond the surface.

    python tests/benchmarks/threads_and_memory.py [--facets N ...] [--json FILE]

Two times of a call: elapsed, and the CPU time of the thread that calls, which on two idle cores is what elapses, and
which other work on the machine does not change much. The minimum of some rounds, taken in turns. Memory is the growth
of the resident set of a child process at its peak (Linux only).
"""

import argparse
import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from synthetic import bumpy, ellipsoid

import voxkernel
from voxkernel.halfspaces import HalfSpaces


def around_a_ball(n):
    """Planes that touch a ball, neighbours near each other; each bounds the kernel."""
    normals = np.random.default_rng(0).normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    x, y, z = np.floor(50.0 * normals.T)
    return HalfSpaces.from_planes(normals[np.lexsort((z, y, x))], np.ones(n))


CASES = {
    "few bound it": lambda n: voxkernel.as_mesh(bumpy(n, 0.5)),
    "a tenth": lambda n: voxkernel.as_mesh(bumpy(n, 0.27)),
    "most": lambda n: voxkernel.as_mesh(bumpy(n, 0.12)),
    "planes, all": around_a_ball,
    "convex surface, all": lambda n: voxkernel.as_mesh(ellipsoid(n)),
}


def times(surface, rounds):
    """Elapsed and CPU seconds of the caller for one and two threads, and the number of faces."""
    best = {threads: [float("inf")] * 2 for threads in (1, 2)}
    faces = 0
    for _ in range(rounds):
        for threads, least in best.items():
            begin = time.perf_counter(), time.thread_time()
            faces = len(voxkernel.exact_kernel(surface, threads=threads).face_facets)
            spent = time.perf_counter() - begin[0], time.thread_time() - begin[1]
            best[threads] = [min(pair) for pair in zip(least, spent, strict=True)]
    return faces, best


def status(key):
    """A line of the status of this process, in bytes."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(key + ":"))


def child(case, n, threads):
    """Print bytes a facet at the peak of one call, and those of its result; to be run in a process of its own."""
    import ctypes
    import gc

    voxkernel.exact_kernel(CASES[case](5000))
    surface = CASES[case](n)
    gc.collect()
    ctypes.CDLL("libc.so.6").malloc_trim(0)
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # the peak begins anew
    before = status("VmRSS")
    kernel = voxkernel.exact_kernel(surface, threads=threads)
    grown = status("VmHWM") - before
    arrays = ("vertices", "face_starts", "face_vertices", "face_facets", "vertex_rows")
    count = len(kernel.certificate.halfspaces)
    print(json.dumps([grown / count, sum(getattr(kernel, name).nbytes for name in arrays) / count]))


def main():
    """Print two tables and write the raw numbers."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--facets", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--json")
    parser.add_argument("--child", nargs=3)
    args = parser.parse_args()
    if args.child:
        child(args.child[0], int(args.child[1]), int(args.child[2]))
        return
    found = {}
    print("| facets, of which bound it | one thread: ms elapsed (CPU) | two | ratio | bytes a facet | of the result |")
    print("|---|---|---|---|---|---|")
    for n in args.facets:
        for case, make in CASES.items():
            faces, best = times(make(n), 8 if n < 300_000 else 3)
            command = [sys.executable, __file__, "--child", case, str(n), "2"]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            peak, kept = json.loads(done.stdout)
            found[f"{case}, {n}"] = {"faces": faces, "seconds": best, "bytes a facet": [peak, kept]}
            (one, one_cpu), (two, two_cpu) = ([1e3 * t for t in best[threads]] for threads in (1, 2))
            print(
                f"| {case}, {n}: {faces} | {one:.0f} ({one_cpu:.0f}) | {two:.0f} ({two_cpu:.0f}) "
                f"| {one / two:.2f} ({one_cpu / two_cpu:.2f}) | {peak:.0f} | {kept:.0f} |",
                flush=True,
            )
    if args.json:
        Path(args.json).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
