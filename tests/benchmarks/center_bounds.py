"""`best_center` on large surfaces by formula: its bounds, CPU time, and memory beyond the half-spaces.

Run with `python tests/benchmarks/center_bounds.py --facets 100000 --json FILE`; with
`PYTHONPATH` at another checkout it measures that version. Each shape is measured in a process of its own.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import voxkernel


def faces_of(n_rows, n_columns):
    """Triangulate a grid of points."""
    a = (np.arange(n_rows - 1)[:, None] * n_columns + np.arange(n_columns - 1)).ravel()
    return np.concatenate([np.c_[a, a + n_columns, a + 1], np.c_[a + 1, a + n_columns, a + n_columns + 1]])


def noisy(n_facets):
    """Scatter the points of a lobed, star-shaped body by an edge."""
    n = int((n_facets / 4) ** 0.5)
    rng = np.random.default_rng(2)
    theta, phi = np.linspace(0.02, np.pi - 0.02, n), np.linspace(-np.pi, np.pi, 2 * n)
    theta, phi = (a.ravel() for a in np.meshgrid(theta, phi, indexing="ij"))
    radius = 1 + 0.25 * np.sin(theta) ** 2 * np.cos(3 * phi) + 0.1 * np.cos(2 * theta)
    unit = np.c_[np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    return unit * radius[:, None] + np.pi / n * rng.normal(size=unit.shape), faces_of(n, 2 * n)


def hooked(n_facets):
    """Bend the ridges of an open, bulging face over."""
    n = int((n_facets / 2) ** 0.5)
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(-1, 1, n),) * 2, indexing="ij"))
    z = 1.2 * (1 - 0.5 * (x**2 + y**2)) + 0.15 * np.cos(9 * x) * np.cos(7 * y)
    x = x + 0.25 * np.sin(4 * y) * np.sin(5 * z)
    return np.c_[x, y, z], faces_of(n, n)


def rough(n_facets):
    """Scatter an open face by an edge, as a bad scanner does."""
    n = int((n_facets / 2) ** 0.5)
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(-1, 1, n),) * 2, indexing="ij"))
    z = 1.2 * (1 - 0.5 * (x**2 + y**2)) + 0.15 * np.cos(9 * x) * np.cos(7 * y)
    return np.c_[x, y, z + np.random.default_rng(3).normal(scale=2 / n, size=len(z))], faces_of(n, n)


SHAPES = {"noisy": noisy, "hooked": hooked, "rough": rough}


def measure(name, n_facets, gap):
    """Run one shape in this process."""
    from voxkernel.halfspaces import HalfSpaces
    from voxkernel.halfspaces.domain import ball_domain

    mesh = voxkernel.as_mesh(SHAPES[name](n_facets))
    halfspaces = HalfSpaces.from_mesh(mesh)
    domain = ball_domain(mesh)
    before = int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
    begin = time.process_time()
    center = voxkernel.best_center(halfspaces, gap=gap, domain=domain)
    seconds = time.process_time() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    low, high = center.violation_bounds
    return {
        "shape": name, "facets": len(halfspaces), "cpu_seconds": round(seconds, 2), "lower": low, "upper": high,
        "cells": center.n_cells, "bytes_a_facet": round((peak - before) / len(halfspaces)),
    }  # fmt: skip


def main():
    """Measure every shape, or one in this process."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--facets", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--gap", type=float, default=1e-4)
    parser.add_argument("--json")
    parser.add_argument("--shape", choices=list(SHAPES))
    arguments = parser.parse_args()
    if arguments.shape:
        print(json.dumps(measure(arguments.shape, arguments.facets[0], arguments.gap)))
        return
    rows = []
    for n in arguments.facets:
        for shape in SHAPES:
            command = [sys.executable, __file__, "--facets", str(n), "--shape", shape, "--gap", str(arguments.gap)]
            found = subprocess.run(command, capture_output=True, text=True, check=True)
            rows.append(json.loads(found.stdout))
            print(rows[-1], flush=True)
    if arguments.json:
        Path(arguments.json).write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
