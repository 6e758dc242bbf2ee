"""Flat sides, planes in memory, the culled octree and many small surfaces: CPU seconds and bytes a facet.

    python tests/benchmarks/flat_and_small.py [--facets N] [--small] [--json FILE]

No rival is asked; `beside_another.py` compares versions. Calls are warmed up, the minimum of three counts.
"""

import argparse
import json
import sys
import time
import tracemalloc
from pathlib import Path

import numpy as np
from synthetic import bumpy, geodesic_sphere

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from shapes import subdivided, uv_sphere

import voxkernel
from voxkernel._core import exact_cells
from voxkernel.exact.convexity import edge_convexity_of
from voxkernel.exact.exact_kernel import kernel_of_halfspaces
from voxkernel.halfspaces import HalfSpaces, find_feasibility
from voxkernel.halfspaces.plane_passes import reaching_planes, tightest_planes
from voxkernel.polyhedral import PackedSurfaces
from voxkernel.relaxed.root_cube import cube_planes, root_cube
from voxkernel.voxels.exact_octree import rows_for_voxels

# Orthogonal but for the factor 3/4: integer points stay on a lattice, and sides in a plane.
TURN = np.array([[2, -1, 2], [2, 2, -1], [-1, 2, 2]]) / 4.0


def flat_cube(n, turn=None):
    """A cube of 12 n^2 facets with corners at integers."""
    line = np.arange(n + 1)
    u, v = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    first = (i * (n + 1) + j).ravel()
    pair = np.concatenate([first[:, None] + [0, n + 1, n + 2], first[:, None] + [0, n + 2, 1]])
    points, faces = [], []
    for axis in range(3):
        for side in (0, n):
            part = np.empty((len(u), 3), np.int64)
            part[:, axis], part[:, (axis + 1) % 3], part[:, (axis + 2) % 3] = side, u, v
            faces.append((pair if side else pair[:, ::-1]) + len(points) * len(u))
            points.append(part)
    points = np.concatenate(points)
    _, kept, number = np.unique(points @ [(n + 1) ** 2, n + 1, 1], return_index=True, return_inverse=True)
    vertices = points[kept].astype(float)
    return voxkernel.as_mesh((vertices if turn is None else vertices @ turn.T, number.ravel()[np.concatenate(faces)]))


def seconds(call, rounds=3):
    """CPU seconds of the fastest of some calls, after one."""
    call()
    best = float("inf")
    for _ in range(rounds):
        begin = time.process_time()
        call()
        best = min(best, time.process_time() - begin)
    return best


def peak(call):
    """Bytes that Python and NumPy hold at the most during a call; what the compiled core holds inside is not seen."""
    tracemalloc.start()
    kept = call()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    del kept
    return most


def flat_rows(n_facets):
    """Sides in a plane: groups, edges, the whole kernel."""
    rows = {}
    n = max(1, round((n_facets / 12) ** 0.5))
    for name, turn in (("axis-aligned", None), ("turned", TURN)):
        mesh = flat_cube(n, turn)
        planes = HalfSpaces.from_mesh(mesh)
        ids = np.arange(len(mesh.faces))
        calls = {
            "coplanar_groups": planes.coplanar_groups,
            "edge_convexity": lambda m=mesh, i=ids: edge_convexity_of(m.vertices, m.faces, i, m.faces),
            "kernel of its merged planes": lambda p=planes: kernel_of_halfspaces(p.merged(), None),
            "exact_kernel": lambda m=mesh: voxkernel.exact_kernel(m),
        }
        for what, call in calls.items():
            rows[f"{what}, {name} cube, {len(ids)} facets"] = seconds(call)
    return rows


def memory_rows(n_facets):
    """Bytes a facet beyond the mesh, of each step."""
    vertices, faces = geodesic_sphere(n_facets)
    mesh = voxkernel.as_mesh((vertices * [1.0, 0.7, 0.5], faces))
    planes = HalfSpaces.from_mesh(mesh)
    point = find_feasibility(planes).local_point
    corners = 0.6 * np.concatenate([np.eye(3), -np.eye(3)])
    calls = {
        "planes": lambda: HalfSpaces.from_mesh(mesh),
        "feasibility": lambda: find_feasibility(planes),
        "culling": lambda: (tightest_planes(planes, point), reaching_planes(planes, point, corners)),
        "coplanar_groups": planes.coplanar_groups,
        "exact_kernel, all bound it": lambda: voxkernel.exact_kernel(mesh),
    }
    return {what: peak(call) / len(faces) for what, call in calls.items()}


def octree_rows(n_facets):
    """The octree at depth 9 with all half-spaces and with those that can make a difference."""
    rows = {}
    for amplitude in (0.5, 0.3, 0.12):
        mesh = voxkernel.as_mesh(bumpy(n_facets, amplitude))
        planes = HalfSpaces.from_mesh(mesh)
        inside = find_feasibility(planes)
        cube, depth = root_cube(mesh.vertices, np.eye(3), depth=9)
        numbers = cube_planes(planes, cube, depth)
        local = cube.edge / planes.scale

        def chosen(p=planes, i=inside, a=numbers, size=local):
            return rows_for_voxels(p, i, a[2], 2.0**-9 * size, a[3].max() * size)

        near = chosen()
        few = [part[near] for part in numbers]
        name = f"bumps {amplitude}, {len(planes)} facets"
        rows[f"octree, all, {name}"] = seconds(lambda a=numbers: exact_cells(*a, 9, False))
        rows[f"octree, {len(near)} kept, {name}"] = seconds(lambda a=few: exact_cells(*a, 9, False))
        rows[f"choosing them, {name}"] = seconds(chosen)
    return rows


def small_rows():
    """Many surfaces of 20 facets packed in arrays, and one by one."""
    rng = np.random.default_rng(0)
    vertices, faces = geodesic_sphere(20)
    n = 5_000
    points = (vertices * rng.uniform(0.5, 1.5, (n, len(vertices), 1))).reshape(-1, 3)
    ids = (faces + np.arange(n)[:, None, None] * len(vertices)).reshape(-1, 3)
    packed = PackedSurfaces(points, ids, np.arange(0, len(ids) + 1, len(faces)))
    one = voxkernel.as_mesh((points[: len(vertices)], faces))
    cube = flat_cube(1)
    found = {}
    for size in (20, 50, 300, 1_000, 3_000, 10_000):
        sphere, triangles = geodesic_sphere(size) if size != 50 else uv_sphere(5, 6)
        mesh = voxkernel.as_mesh((sphere * rng.uniform(0.85, 1.15, (len(sphere), 1)), triangles))
        name = f"exact_kernel, star of {len(triangles)} facets"
        found[name] = seconds(lambda m=mesh: voxkernel.exact_kernel(m), max(10, 20_000 // size))
    flat = subdivided(vertices, faces)
    moved = [(flat[0] + 1e-8 * rng.normal(size=flat[0].shape), flat[1]) for _ in range(200)]
    near = [voxkernel.as_mesh(surface) for surface in moved]
    return {
        "exact_kernel, cube": seconds(lambda: voxkernel.exact_kernel(cube), 1000),
        **found,
        "exact_kernels, a surface of 80 facets that are nearly coplanar in fours": seconds(
            lambda: voxkernel.exact_kernels(near)
        )
        / len(near),
        "exact_kernels, a surface of 20 facets, a fifth of them convex": seconds(
            lambda: voxkernel.exact_kernels(packed), 10
        )
        / n,
        "exact_kernel of one of them": seconds(lambda: voxkernel.exact_kernel(one), 200),
    }


def main():
    """Print a table and write the raw numbers."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--facets", type=int, default=1_000_000)
    parser.add_argument("--small", action="store_true", help="the small surfaces only")
    parser.add_argument("--json")
    args = parser.parse_args()
    found = {"seconds": small_rows()}
    if not args.small:
        found["seconds"] |= {**flat_rows(args.facets), **octree_rows(args.facets // 10)}
        found["bytes a facet"] = memory_rows(args.facets // 10)
    for unit, rows in found.items():
        print(f"| what | {unit} |\n|---|---|")
        for what, number in rows.items():
            print(f"| {what} | {number:.3g} |")
    if args.json:
        Path(args.json).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
