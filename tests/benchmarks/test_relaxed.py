"""Relaxed kernels and star centres beside the prototypes the targets were set with, and beside a dense sweep.

The prototypes are timed on the planes in memory; `loop` is our compiled loop on the same planes and cube, `call`
the whole public call from a mesh in memory, with half-spaces, domain and grid.
"""

import subprocess
import sys

import numpy as np
import pytest
from synthetic import bumpy, geodesic_sphere

import voxkernel
from voxkernel._core import least_violated, relaxed_cells
from voxkernel.halfspaces import HalfSpaces, planes_domain
from voxkernel.relaxed.facet_weights import UNITS, weigh
from voxkernel.relaxed.root_cube import RootCube, cube_arrays, cube_frame

ALPHA = 0.03
NEVER = 99
CENTERS = (
    "faces/ict01_neutral",
    "faces/ict06_smile",
    "faces/ict08_smile",
    "scans/scan_ict01_neutral",
    "scans/scan_ict06_neutral",
    "asteroids/bennu",
    "asteroids/eros",
    "asteroids/churyumov-gerasimenko",
    "closed/common3d_cow",
    "closed/common3d_homer",
)


class Problem:
    """A mesh, its planes as the prototypes take them, and the same cube for both."""

    def __init__(self, path):
        self.mesh = voxkernel.as_mesh(path)
        used = self.mesh.vertices[np.unique(self.mesh.faces)]
        low, high = used.min(axis=0), used.max(axis=0)
        edge = float((high - low).max()) * 1.3
        corner = 0.5 * (low + high) - 0.5 * edge
        self.domain = planes_domain(np.r_[np.eye(3), -np.eye(3)], np.r_[corner + edge, -corner])
        halfspaces = HalfSpaces.from_mesh(self.mesh)
        normals = np.array(halfspaces.normals)
        weights = halfspaces.weights / halfspaces.weights.sum()
        offsets = (halfspaces.offsets - normals @ corner) / edge
        self.planes = normals, offsets, np.ascontiguousarray(weights), np.abs(normals).sum(axis=1)
        self.weighed, self.cube = weigh(halfspaces), RootCube(corner, edge, np.eye(3))

    def loop(self, depth):
        """Run the compiled octree alone."""
        normals, offsets, reach, pads, weights, n = cube_arrays(self.weighed, self.domain, self.cube, depth)
        ins, outs = self.weighed.thresholds([ALPHA])
        padded = (reach + pads * 2.0 ** (depth + 1))[n:]
        numbers = np.column_stack([normals[n:], padded, 0.5 * normals[n:].sum(axis=1) - offsets[n:]])
        return relaxed_cells(
            numbers, weights[n:], 0, 0, ins, outs, np.array([0, 1]), depth, -1, np.zeros(3, np.int64), NEVER, False
        )

    def call(self, depth, threads=1, **options):
        """Run the public function in the same cube."""
        return voxkernel.voxel_kernel(
            self.mesh, tolerance=ALPHA, depth=depth, threads=threads, **{"domain": self.domain, **options}
        )

    def prototype(self, module, depth):
        """Run the prototype's octree, which only counts."""
        normals, offsets, weights, reach = self.planes
        return module.run(normals, offsets, weights, reach, depth, ALPHA, np.zeros(3, np.int64))


@pytest.fixture(scope="module")
def face(data_dir):
    return Problem(data_dir / "faces" / "ict01_neutral.ply")


@pytest.mark.parametrize("depth", [6, 7, 8, 9])
def test_octree_beside_the_prototype(side_by_side, prototype, face, depth):
    module = prototype("relaxed_octree")
    rivals = {
        "prototype": lambda: face.prototype(module, depth),
        "loop": lambda: face.loop(depth),
        "call": lambda: face.call(depth),
        "call, ball domain": lambda: face.call(depth, domain=None),
    }
    face.prototype(module, 4), face.loop(4), face.call(4)
    answer = side_by_side(f"face of {len(face.mesh.faces)} facets, alpha {ALPHA}, depth {depth}", rivals)
    low, more = answer["prototype"][1]
    n_inside, n_boundary = answer["loop"][1][7:9]
    voxel = 0.125**depth
    assert n_inside[0] * voxel == pytest.approx(low, rel=1e-6)
    assert n_boundary[0] * voxel == pytest.approx(more, rel=1e-6)


def test_threads(side_by_side, face):
    face.call(4, threads=2)
    answer = side_by_side(
        "face, depth 9", {"two threads": lambda: face.call(9, threads=2), "one": lambda: face.call(9, threads=1)}
    )
    assert answer["one"][1].volume_bounds == answer["two threads"][1].volume_bounds


def test_growth_per_level(side_by_side, face):
    face.loop(4)
    side_by_side("face, loop", {f"depth {d}": lambda d=d: face.loop(d) for d in range(6, 11)})


@pytest.mark.parametrize("depth", [5, 6])
def test_beside_the_dense_sweep(side_by_side, prototype, face, depth):
    """The sweep costs 8x more per level; at depth 9 it is extrapolated from here (the last rival is for that)."""
    module = prototype("relaxed_octree")
    normals, offsets, weights, _ = face.planes
    module.dense(normals, offsets, weights, 2, ALPHA)
    face.loop(4)
    side_by_side(
        f"face, depth {depth}; sweep on all threads",
        {
            "octree": lambda: face.loop(depth),
            "dense sweep": lambda: module.dense(normals, offsets, weights, depth, ALPHA),
            "octree at depth 9": lambda: face.loop(9),
        },
        rounds=2,
    )


@pytest.mark.parametrize("name", CENTERS)
def test_center_beside_the_prototype(side_by_side, prototype, data_dir, name):
    module = prototype("best_center")
    problem = Problem(data_dir / f"{name}.ply")
    normals, offsets, weights, reach = problem.planes
    facets = problem.weighed.facets
    arrays = facets.local_normals, facets.local_offsets, facets.local_errors, problem.weighed.weights
    no_border = np.empty((0, 3)), np.empty(0), np.empty(0)

    def loop(max_level=15, gap=1e-4):
        return least_violated(
            *arrays, cube_frame(facets, problem.cube, 14), *no_border, 1e-15, UNITS, int(gap * UNITS), 0.0,
            max_level, 10**8, 1, np.zeros(3), np.zeros(4),
        )  # fmt: skip

    module.bb(normals, offsets, weights, reach, 0.5, 3), loop(3, 0.5), voxkernel.best_center(problem.mesh)
    answer = side_by_side(
        f"{name}, {len(problem.mesh.faces)} facets, gap 1e-4",
        {
            "prototype": lambda: module.bb(normals, offsets, weights, reach, 1e-4, 14),
            "loop": loop,
            "call": lambda: voxkernel.best_center(problem.mesh),
        },
    )
    best, lower, _ = answer["loop"][1]
    assert best / UNITS == pytest.approx(answer["prototype"][1][0], abs=2e-4)
    assert best - lower <= 1.001e-4 * UNITS


@pytest.mark.parametrize("n_facets", [100_000, 1_000_000])
@pytest.mark.parametrize("shape", ["two lobes", "noisy sphere"])
def test_large_centers(side_by_side, shape, n_facets):
    rng = np.random.default_rng(0)
    if shape == "two lobes":
        vertices, faces = bumpy(n_facets, 0.5)
        vertices = vertices * (0.3 + np.abs(vertices[:, :1]))
    else:
        vertices, faces = geodesic_sphere(n_facets)
        vertices = vertices * (1 + rng.normal(0, 1.0 / n_facets**0.5, (len(vertices), 1)))
    mesh = voxkernel.TriangleMesh.from_triangles(vertices, faces)
    answer = side_by_side(f"{shape}, {len(faces)} facets", {"call": lambda: voxkernel.best_center(mesh)}, rounds=2)
    assert answer["call"][1].gap <= 1.001e-4


MEMORY = """
import sys
from pathlib import Path
import numpy as np
import voxkernel

def peak():
    # Of this process alone, in kB: what getrusage gives is inherited from the parent.
    return int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0])

mesh = voxkernel.TriangleMesh.from_triangles(np.load(sys.argv[1]), np.load(sys.argv[2]))
voxkernel.voxel_kernel(mesh, tolerance=0.1, depth=3)
before = peak()
grid = voxkernel.voxel_kernel(mesh, tolerance=0.1, depth=9)
after = peak()
print(before / 1024, after / 1024, grid.leaf_ijk.shape[0])
"""


def test_peak_memory(tmp_path, capsys):
    vertices, faces = bumpy(100_000, 0.5)
    np.save(tmp_path / "vertices.npy", vertices * (1 + 0.2 * vertices[:, :1]))
    np.save(tmp_path / "faces.npy", faces)
    command = [sys.executable, "-c", MEMORY, tmp_path / "vertices.npy", tmp_path / "faces.npy"]
    before, after, leaves = map(
        float, subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    )
    with capsys.disabled():
        print(f"\n100k facets, depth 9, {leaves:.0f} leaves: peak {after:.0f} MB, of them {before:.0f} MB before")
    assert after < 300
