"""Facts of damaged surfaces against a slow formulation of them, and what the compiled loops do beyond."""

import pickle
import signal

import facts_oracle
import numpy as np
import pytest
import shapes

from voxkernel import _core
from voxkernel.mesh import TriangleMesh, as_mesh, surface_sums

EXACT = [
    "is_closed",
    "n_boundary_edges",
    "n_nonmanifold_edges",
    "is_oriented",
    "is_outward",
    "n_components",
    "euler_characteristic",
    "genus",
    "n_facets",
    "n_unreferenced_vertices",
    "n_duplicate_facets",
]


def assert_same(mesh):
    facts, expected = mesh.facts(), facts_oracle.facts_of(mesh)
    assert {name: getattr(facts, name) for name in EXACT} == {name: expected[name] for name in EXACT}
    assert [loop.tolist() for loop in facts.boundary_loops] == expected["boundary_loops"]
    assert facts.degenerate_facets.tolist() == expected["degenerate_facets"]
    np.testing.assert_array_equal(facts.bbox, expected["bbox"])
    reach = np.abs(facts.bbox).max()
    assert facts.area == pytest.approx(expected["area"], rel=1e-12)
    assert facts.volume == pytest.approx(expected["volume"], rel=1e-12, abs=1e-12 * reach**3, nan_ok=True)
    np.testing.assert_allclose(facts.area_centroid, expected["area_centroid"], rtol=0, atol=1e-12 * reach)


def soup(rng, n_vertices, n_faces):
    """Triangles of any vertices, some named twice."""
    return rng.integers(-4, 5, (n_vertices, 3)).astype(float), rng.integers(0, n_vertices, (n_faces, 3))


def damaged(rng, vertices, faces):
    """Turned, doubled, missing and collapsed triangles, welded and unused vertices."""
    faces = faces[rng.permutation(len(faces))]
    kinds = rng.random(len(faces))
    rate = rng.choice([0.0, 0.01, 0.1], size=4)
    turned = kinds < rate[0]
    faces[turned] = faces[turned, ::-1]
    faces = np.concatenate([faces, np.roll(faces[rng.random(len(faces)) < rate[1]], 1, axis=1)])
    faces = faces[rng.random(len(faces)) >= rate[2]]
    flat = rng.random(len(faces)) < rate[3]
    faces[flat, 1] = faces[flat, 0]
    if rng.random() < 0.5 and len(vertices) > 6:
        one, two = rng.integers(0, len(vertices), 2)
        faces[faces == one] = two
    return np.concatenate([vertices, 1e3 + rng.random((rng.integers(0, 3), 3))]), faces


@pytest.mark.parametrize("seed", range(60))
def test_soups(seed):
    rng = np.random.default_rng(seed)
    vertices, faces = soup(rng, int(rng.integers(4, 40)), int(rng.integers(1, 80)))
    if np.linalg.norm(np.cross(*(vertices[faces[:, k]] - vertices[faces[:, 0]] for k in (1, 2)))) > 0:
        assert_same(TriangleMesh.from_triangles(vertices, faces))


CLOSED = [
    shapes.icosphere(2),
    shapes.torus(),
    shapes.cubes_sharing_an_edge(),
    shapes.two_boxes(),
    shapes.crossing_boxes(),
    shapes.inside_out_cube(),
    shapes.cube_with_flipped_face(),
    shapes.three_faces_on_an_edge(),
    shapes.moebius_band(),
    shapes.open_box(),
]


@pytest.mark.parametrize("shape", range(len(CLOSED)))
def test_damaged_surfaces(shape):
    assert_same(TriangleMesh.from_triangles(*CLOSED[shape]))
    for seed in range(10):
        mesh = damaged(np.random.default_rng([shape, seed]), *CLOSED[shape])
        assert_same(TriangleMesh.from_triangles(*mesh))


def test_closed_surfaces_that_touch():
    """In a vertex: one component of two fans, so without a genus; and with a triangle without edges."""
    vertices, faces = shapes.tetrahedron()
    both = np.concatenate([vertices, -vertices[1:] - 2.0 * (vertices[0] != 0)])
    touching = np.concatenate([faces, np.where(faces > 0, faces + 3, 0)])
    both[0] = 0.0
    for faces in (touching, np.concatenate([[[0, 0, 1]], touching, [[4, 5, 5]]])):
        mesh = TriangleMesh.from_triangles(both, faces)
        assert_same(mesh)
        assert mesh.facts().n_components == 1
        assert mesh.facts().genus is None


def test_a_doubled_sheet_has_no_volume():
    """Exactly 0 is not > 0, whatever floats say."""
    vertices, faces = shapes.height_field(n=6)
    mesh = TriangleMesh.from_triangles(vertices / 3.0, np.concatenate([faces, faces[:, ::-1]]))
    if mesh.facts().is_closed:
        assert mesh.facts().is_outward is False
    assert_same(mesh)


@pytest.mark.parametrize("seed", range(10))
def test_polygons(seed):
    """Facets of several triangles, some twice with other corners first, and triangles among them."""
    rng = np.random.default_rng(seed)
    vertices, polygons = shapes.truncated_octahedron()
    chosen = [polygons[i] for i in rng.integers(0, len(polygons), 12)]
    polygons = [np.roll(p, rng.integers(0, 4))[:: rng.choice([-1, 1])].tolist() for p in chosen]
    polygons += [list(p[:3]) for p in polygons[:4]]
    mesh = TriangleMesh.from_polygons(vertices, polygons)
    assert_same(mesh)
    assert mesh.facts().n_duplicate_facets > 0


@pytest.mark.parametrize("damage", ["none", "damaged", "soup", "bodies"])
@pytest.mark.parametrize("block", [1, 7, 1000])
def test_blocks_of_any_size_give_the_same(monkeypatch, block, damage):
    """Sums run over blocks of triangles, and a part may be in many of them."""
    monkeypatch.setattr(surface_sums, "_BLOCK", block)
    rng = np.random.default_rng(7)
    vertices, faces = shapes.torus(n_major=40, n_minor=20)
    if damage == "damaged":
        faces = faces[rng.random(len(faces)) < 0.9]
    elif damage == "soup":
        vertices, faces = vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    elif damage == "bodies":
        (corners, own), n = shapes.tetrahedron(), 300
        shifts = 3.0 * np.stack(np.unravel_index(np.arange(n), (7, 7, 7)), axis=1)
        vertices = (corners + shifts[:, None]).reshape(-1, 3)
        faces = (own + 4 * np.arange(n)[:, None, None]).reshape(-1, 3)
        faces = np.concatenate([faces[:401], [[5, 5, 6]], faces[401:]])
    assert_same(TriangleMesh.from_triangles(vertices, faces[rng.permutation(len(faces))]))


def test_more_triangles_than_a_block():
    mesh = TriangleMesh.from_triangles(*shapes.torus(n_major=220, n_minor=160))
    facts = mesh.facts()
    assert len(mesh.faces) > surface_sums._BLOCK
    assert facts.genus == 1
    assert facts.area == pytest.approx(np.linalg.norm(mesh.plane_areas, ord=1), rel=1e-13)
    assert facts.volume == pytest.approx(2 * np.pi**2 * 2.0 * 0.5**2, rel=1e-3)


def test_wide_numbers_give_the_same():
    """Of surfaces of more than 715 million triangles; no test holds one."""
    for seed, shape in enumerate(CLOSED):
        vertices, faces = damaged(np.random.default_rng(seed), *shape)
        faces = np.ascontiguousarray(faces)
        for number in range(2):
            if number == 1:
                vertices, faces = shape
            small, wide = (_core.surface_edges(faces, len(vertices), is_wide) for is_wide in (False, True))
            for one, two in zip(small, wide, strict=True):
                np.testing.assert_array_equal(one, two)
            ids = np.sort(np.random.default_rng(seed).integers(0, len(faces), len(faces)))
            small, wide = (_core.duplicate_facets(faces, ids, len(vertices), is_wide) for is_wide in (False, True))
            assert small == wide == facts_oracle.n_duplicates(faces, ids)


def test_parts_are_numbered_by_their_first_triangle():
    vertices, faces = shapes.two_boxes()
    half = len(faces) // 2
    mixed = np.concatenate([[[0, 0, 1]], faces[half:], faces[:half]])
    *_, n_parts, parts = _core.surface_edges(mixed, len(vertices))
    assert n_parts == 2
    assert parts.tolist() == [-1] + [0] * half + [1] * half


def test_loops_are_a_sequence(rng):
    """Arrays of int64 that are read-only; from either end, in slices, after a pickle."""
    faces = np.arange(30).reshape(10, 3)
    loops = as_mesh((rng.normal(size=(30, 3)), faces)).facts().boundary_loops
    assert len(loops) == 10
    assert [loop.tolist() for loop in loops] == faces.tolist()
    assert loops[-1].tolist() == faces[-1].tolist()
    assert [loop.tolist() for loop in loops[2:8:3]] == faces[2:8:3].tolist()
    assert (loops[0].dtype, loops[0].flags.writeable) == (np.int64, False)
    with pytest.raises(IndexError):
        loops[10]
    assert [loop.tolist() for loop in pickle.loads(pickle.dumps(loops))] == faces.tolist()
    assert repr(loops) == "BoundaryLoops(10 loops, 30 vertices)"


@pytest.mark.parametrize("seed", range(5))
def test_loops_of_wide_numbers_are_those_of_narrow_ones(seed):
    rng = np.random.default_rng(seed)
    _, faces = soup(rng, 40, 60)
    border = _core.surface_edges(faces, 40)[4]
    narrow, wide = (_core.boundary_loops(faces, 40, border, is_wide) for is_wide in (False, True))
    assert {part.dtype.name for part in narrow} == {"int32"}
    assert {part.dtype.name for part in wide} == {"int64"}
    assert all(map(np.array_equal, narrow, wide))


def test_memory_that_is_not_there():
    nothing, ids = np.empty((0, 3), np.int64), np.empty(0, np.int64)
    with pytest.raises(MemoryError):
        _core.surface_edges(nothing, 1 << 57)
    with pytest.raises(MemoryError):
        _core.duplicate_facets(nothing, ids, 1 << 57)
    with pytest.raises(MemoryError):
        _core.boundary_loops(nothing, 1 << 57, ids)


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers on this system")
@pytest.mark.parametrize("loop", ["surface_edges", "duplicate_facets"])
def test_signals_are_heard_during_a_loop(rng, loop):
    """Again and again: between two calls Python would hear of many signals once."""
    faces = rng.integers(0, 500_000, (1_500_000, 3))
    ids = [np.arange(len(faces))] if loop == "duplicate_facets" else []
    heard = []
    before = signal.signal(signal.SIGALRM, lambda *_: heard.append(None))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.02, 0.02)
        getattr(_core, loop)(faces, *ids, 500_000)
        n = len(heard)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert n >= 2
