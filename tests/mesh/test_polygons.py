"""Triangles of polygons: the area law, closed seams, and time that grows with the corners, not with their square."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import voxkernel
from voxkernel.errors import MeshError
from voxkernel.mesh import TriangleMesh


def in_child(code, seconds=120):
    """Run code that could hang; a generous guard, not a measurement."""
    env = {**os.environ, "PYTHONPATH": str(Path(voxkernel.__file__).parent.parent)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=seconds, env=env)
    assert done.returncode == 0, done.stderr
    return done.stdout


def cut(outline, loop=None):
    outline = np.asarray(outline, dtype=float)
    loop = np.arange(len(outline)) if loop is None else np.asarray(loop)
    return TriangleMesh.from_polygons(np.c_[outline, np.zeros(len(outline))], [loop]), loop


def fills(mesh, loop):
    """The triangles are turned as the polygon, their areas add up to its area, and its border is theirs."""
    x, y = mesh.vertices[loop, :2].T
    area = 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    parts = 0.5 * np.cross(b - a, c - a)[:, 2] * np.sign(area)
    assert mesh.faces.shape == (len(loop) - 2, 3)
    assert parts.min() >= -1e-12 * abs(area)
    assert parts.sum() == pytest.approx(abs(area), rel=1e-12)
    directed = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    balance = np.zeros((len(mesh.vertices),) * 2, dtype=int)
    np.add.at(balance, tuple(directed.T), 1)
    np.add.at(balance, (loop, np.roll(loop, -1)), -1)
    assert (balance == balance.T).all()


def polyomino(seed, n):
    """Border of n unit squares that hang together: straight corners in plenty; None where it touches itself."""
    rng = np.random.default_rng(seed)
    cells = [(0, 0)]
    while len(cells) < n:
        (x, y), (dx, dy) = cells[rng.integers(len(cells))], [(1, 0), (-1, 0), (0, 1), (0, -1)][rng.integers(4)]
        if (x + dx, y + dy) not in cells:
            cells.append((x + dx, y + dy))
    sides = set()
    for x, y in cells:
        ring = [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)]
        sides |= set(zip(ring, ring[1:] + ring[:1], strict=True))
    sides = [side for side in sides if side[::-1] not in sides]
    border = dict(sides)
    walk = [min(border)]
    while len(border) == len(sides) and border[walk[-1]] != walk[0]:
        walk.append(border[walk[-1]])
    return walk if len(walk) == len(sides) else None


@given(st.integers(0, 2**32 - 1), st.integers(2, 60), st.floats(0, 6.3), st.booleans())
def test_polyominoes(seed, n, angle, backward):
    outline = polyomino(seed, n)
    assume(outline is not None)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    mesh, loop = cut(np.array(outline) @ turn.T, np.arange(len(outline))[:: -1 if backward else 1])
    fills(mesh, loop)


TOUCHING = {
    "a cut to a hole": (
        [(0, 0), (4, 0), (4, 4), (0, 4), (1, 1), (1, 3), (3, 3), (3, 1)], [0, 1, 2, 3, 0, 4, 5, 6, 7, 4], 12,
    ),
    "two squares on a corner": ([(0, 0), (4, 0), (4, 4), (8, 4), (8, 8), (4, 8), (0, 4)], [0, 1, 2, 3, 4, 5, 2, 6], 32),
    "two squares on a line": (
        [(0, 0), (4, 0), (4, 4), (5, 5), (8, 5), (8, 8), (5, 8), (0, 4)], [0, 1, 2, 3, 4, 5, 6, 3, 2, 7], 25,
    ),
    "a spike": ([(0, 0), (4, 0), (4, 4), (4, 6), (0, 4)], [0, 1, 2, 3, 2, 4], 16),
    "corners given again": ([(0, 0), (4, 0), (4, 4), (0, 4)], [0, 0, 0, 1, 2, 2, 2, 2, 3], 16),
}  # fmt: skip


@pytest.mark.parametrize("name", TOUCHING)
@pytest.mark.parametrize("backward", [False, True])
def test_polygons_that_touch_themselves(name, backward):
    outline, loop, area = TOUCHING[name]
    mesh, loop = cut(outline, loop[::-1] if backward else loop)
    fills(mesh, loop)
    assert mesh.plane_areas.tolist() == [area]


@pytest.mark.parametrize("n", [6, 999, 60_000])
def test_a_polygon_of_several_loops_is_refused(n):
    code = (
        "from voxkernel import TriangleMesh\n"
        "square = [[9, 9, 0], [8, 9, 0], [8, 8, 0]]\n"
        f"polygons = [[3, 4, 5, 6], [0, 1, 2] * ({n} // 3)]\n"
        "corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]\n"
        "try:\n    TriangleMesh.from_polygons(corners, polygons)\n"
        "except ValueError as error:\n    print(type(error).__name__, error)\n"
    )
    text = f"MeshError `polygons` must be one loop each; got vertex 0 {n // 3} times in polygon 1"
    assert in_child(code).startswith(text)


def test_repeated_corners_are_named_with_the_file(tmp_path):
    path = tmp_path / "twice.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 1 2 3\n")
    with pytest.raises(MeshError, match=r"twice\.obj.*one loop each; got vertex 0 2 times in polygon 0"):
        voxkernel.as_mesh(path)


@pytest.mark.parametrize("shape", ["star", "comb", "spiral"])
def test_a_polygon_of_60000_corners(shape):
    code = f"""
import numpy as np
from voxkernel import TriangleMesh
n = 60_000
k = np.arange(n)
if {shape!r} == "star":
    radius, angle = np.where(k % 2, 0.5, 1.0), 2 * np.pi * k / n
    outline = np.c_[radius * np.cos(angle), radius * np.sin(angle)]
    area = 0.5 * np.sin(2 * np.pi / n) * 0.5 * n  # n triangles with sides 1 and 0.5
elif {shape!r} == "comb":
    x = np.arange(n // 2)
    outline = np.r_[np.c_[x, np.full(n // 2, -1.0)], np.c_[x, x % 2][::-1]]
    area = 1.5 * (n // 2 - 1)  # trapezoids with sides 1 and 2
else:
    angle = np.linspace(3, 90, n // 2)
    arm = np.c_[np.cos(angle), np.sin(angle)]
    outline = np.r_[arm * angle[:, None], (arm * (angle - 2)[:, None])[::-1]]
    x, y = outline.T
    area = 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
mesh = TriangleMesh.from_polygons(np.c_[outline, 0 * k], [k])
a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
parts = 0.5 * np.cross(b - a, c - a)[:, 2]
print(len(parts), parts.min() > 0, abs(parts.sum() / area - 1) < 1e-9, abs(mesh.plane_areas[0] / area - 1) < 1e-9)
p, q, r = mesh.vertices[mesh.plane_corners[0]]
print(np.cross(q - p, r - p)[2] > 0.2 * np.ptp(outline, axis=0).prod() * ({shape!r} != "comb"))
"""
    assert in_child(code).split() == ["59998", "True", "True", "True", "True"]


@pytest.mark.parametrize("n", [255, 256, 257, 1001])
def test_plane_corners_are_well_spread_for_any_number_of_corners(n, rng):
    """Of an ellipse 10 by 1 the two ends of the long axis are taken, and a corner at the end of the short one."""
    angle = 2 * np.pi * (np.arange(n) + rng.random()) / n
    mesh, _ = cut(np.c_[10 * np.cos(angle), np.sin(angle)])
    p, q, r = mesh.vertices[mesh.plane_corners[0]]
    assert np.cross(q - p, r - p)[2] == pytest.approx(20, rel=1e-2)
    assert len(mesh.plane_corners) == 1


def test_a_crossing_polygon_of_many_turns_does_not_hang():
    """{4000/1334}: earcut alone looks at all pairs of corners of such a star, again and again."""
    code = (
        "import numpy as np\nfrom voxkernel import TriangleMesh\n"
        "angle = 2 * np.pi * np.arange(8000) * 2667 / 8000\n"
        "ring = np.c_[np.cos(angle), np.sin(angle), 0 * angle]\n"
        "print(TriangleMesh.from_polygons(ring, [range(8000)]).faces.shape)\n"
    )
    assert in_child(code).strip() == "(7998, 3)"
