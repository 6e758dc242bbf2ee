"""What other functions say of a streamed surface is what they say in memory."""

import sys

import numpy as np
import pytest
import shapes
from streams import write_ball

import voxkernel
from voxkernel.measures.streamed_convexity import lies_in_kernel
from voxkernel.voxels import streamed_rows

STAR = shapes.star_prism()
SPIKY = shapes.spiky(3)
POINTS = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 3))


@pytest.mark.parametrize("chunk", [1, 7, 1000])
@pytest.mark.parametrize("weights", ["area", "count", "array"])
def test_violation(chunk, weights):
    mesh = shapes.torus(n_major=12, n_minor=6)
    given = np.arange(len(mesh[1])) % 5 * 0.1 if weights == "array" else weights
    points = np.concatenate([POINTS, mesh[0][:5]])  # corners lie on planes
    found = voxkernel.violation(voxkernel.stream_mesh(mesh, chunk_facets=chunk), points, weights=given)
    np.testing.assert_array_equal(found, voxkernel.violation(mesh, points, weights=given))
    if chunk == 7:
        surface = voxkernel.stream_mesh(mesh, chunk_facets=chunk)
        np.testing.assert_array_equal(voxkernel.violation(surface, points, weights=given, threads=3), found)


def test_weights_that_cannot_be():
    surface = voxkernel.stream_mesh(STAR, chunk_facets=7)
    with pytest.raises(ValueError, match=r"`weights` must have shape \(28,\), one for each facet; got \(3,\)"):
        voxkernel.violation(surface, POINTS, weights=[1, 2, 3])
    with pytest.raises(ValueError, match="`weights` must be finite and >= 0"):
        voxkernel.violation(surface, POINTS, weights=np.full(28, -1.0))
    with pytest.raises(ValueError, match="`weights` must have one above 0; got only zeros"):
        voxkernel.violation(surface, POINTS, weights=np.zeros(28))
    with pytest.raises(ValueError, match="`weights` must be 'area', 'count' or an array; got 'volume'"):
        voxkernel.violation(surface, POINTS, weights="volume")
    with pytest.raises(ValueError, match="`weights` must be 'area' or 'count' for a streamed surface; got an array"):
        voxkernel.best_center(surface, weights=np.ones(28))


@pytest.mark.parametrize(
    "mesh",
    [STAR, SPIKY, shapes.icosphere(2), shapes.notched_cube(), shapes.open_box(), shapes.inside_out_cube()],
    ids=["star", "spiky", "convex", "point", "open", "inwards"],
)
def test_starshapeness(mesh):
    streamed, whole = (voxkernel.starshapeness(s) for s in (voxkernel.stream_mesh(mesh, chunk_facets=99), mesh))
    assert streamed.to_dict() == whole.to_dict()


def test_a_cube_of_many_facets_is_convex():
    mesh = shapes.cube()
    for _ in range(3):
        mesh = shapes.subdivided(*mesh)
    score = voxkernel.starshapeness(voxkernel.stream_mesh(mesh, chunk_facets=777))
    assert (score.ratio, score.verdict, score.n_facets) == (1.0, "star-shaped", 12 * 4**3)
    assert len(score.certificate.halfspaces) < 300  # one facet of each side, and the first working set


def test_guards_are_refused():
    with pytest.raises(ValueError, match="`detail` must be True or False for a stream, as guards need all of it"):
        voxkernel.starshapeness(voxkernel.stream_mesh(STAR), detail="guards")


DETAILED = {
    "star": STAR, "rooms": shapes.two_boxes(), "torus": shapes.torus(), "open": shapes.open_box(), "spiky": SPIKY,
    "inwards": shapes.inside_out_cube(),
}  # fmt: skip


@pytest.mark.parametrize("name", DETAILED)
@pytest.mark.parametrize("chunk", [1, 7, 1000])
def test_detail(name, chunk):
    """Rays and relaxed kernels of a stream are those in memory; its blocks do not depend on the chunks."""
    mesh = DETAILED[name]
    surface = voxkernel.stream_mesh(mesh, chunk_facets=chunk)
    found, whole = (voxkernel.starshapeness(s, detail=True, gap=1e-2).to_dict() for s in (surface, mesh))
    # The volume of a hull of hulls is rounded in another order.
    shares, expected = (score["profile"].pop("volume_share_bounds") for score in (found, whole))
    np.testing.assert_allclose(shares, expected, rtol=1e-12)
    assert found == whole


@pytest.mark.parametrize("block", [50, 64, 1000])
@pytest.mark.parametrize("name", ["rooms", "torus", "spiky", "open"])
def test_rays_ask_block_by_block(name, block, monkeypatch):
    """The same spots, and of each ray the nearest hit of all blocks: the same share."""
    mesh, points = DETAILED[name], np.concatenate([POINTS[:4], [[0.5, 0.5, 0.5], [2.0, 0.0, 0.1]]])
    monkeypatch.setattr("voxkernel.large.surface_reader.BLOCK", block)
    for point in points:
        found = voxkernel.visible_fraction(voxkernel.stream_mesh(mesh, chunk_facets=77), point, n_samples=3000, rng=5)
        whole = voxkernel.visible_fraction(mesh, point, n_samples=3000, rng=5)
        assert found.to_dict() == whole.to_dict()


def test_an_empty_kernel_has_a_center():
    mesh = shapes.torus()
    surface = voxkernel.stream_mesh(mesh, chunk_facets=100)
    whole = voxkernel.best_center(mesh, gap=1e-3)
    assert voxkernel.best_center(surface, gap=1e-3).to_dict() == whole.to_dict()
    score = voxkernel.starshapeness(surface, gap=1e-3)
    assert (score.verdict, score.violation_bounds) == ("not star-shaped", whole.violation_bounds)


def test_a_surface_beyond_its_kernel_is_not_convex():
    # All planes bound the kernel, the unit cube, but a second cube touches it at a corner.
    vertices, faces = shapes.joined(shapes.cube(), shapes.box((1, 1, 1), (1.0001, 1.0001, 1.0001)))
    surface = voxkernel.stream_mesh((vertices, faces))
    kernel = voxkernel.exact_kernel(shapes.cube())
    assert not lies_in_kernel(surface._reader, kernel)
    assert lies_in_kernel(voxkernel.stream_mesh(shapes.subdivided(*shapes.cube()), chunk_facets=5)._reader, kernel)


def test_thick_planes_leave_bounds_certain(monkeypatch):
    mesh = shapes.torus(n_major=60, n_minor=30)
    low, high = voxkernel.best_center(mesh, gap=1e-3).violation_bounds
    monkeypatch.setattr("voxkernel.relaxed.streamed_center._MOST_PLANES", 600)
    center = voxkernel.best_center(voxkernel.stream_mesh(mesh, chunk_facets=500), gap=1e-3)
    assert 0.0 < center.violation_bounds[0] <= high
    assert center.violation_bounds[1] >= low
    assert "3,600 planes were gathered in" in center.reason
    assert voxkernel.violation(mesh, center.point[None])[0] == pytest.approx(center.violation_bounds[1], abs=1e-12)


@pytest.mark.parametrize("options", [{"depth": 6}, {"voxel_size": 0.07}, {"rtol": 0.1}, {"depth": 5, "domain": "box"}])
@pytest.mark.parametrize("mesh", [STAR, SPIKY, shapes.open_box(), shapes.two_boxes()], ids=range(4))
def test_voxels_are_those_of_memory(mesh, options):
    streamed = voxkernel.voxel_kernel(voxkernel.stream_mesh(mesh, chunk_facets=99), **options)
    whole = voxkernel.voxel_kernel(mesh, **options)
    assert streamed.volume_bounds == whole.volume_bounds
    assert streamed.to_dict() == whole.to_dict()
    threaded = voxkernel.voxel_kernel(voxkernel.stream_mesh(mesh, chunk_facets=99), threads=2, **options)
    assert threaded.to_dict() == whole.to_dict()


@pytest.mark.parametrize("options", [{"depth": 3}, {"depth": 4}, {"depth": 7}, {"rtol": 0.2}], ids=str)
@pytest.mark.parametrize("how", ["all", "nearest", "none"])
def test_voxels_are_those_of_memory_whatever_bounds_their_centers(tmp_path, monkeypatch, how, options):
    """Of planes that nearly all pass within a voxel of the kernel few are kept, and no voxel changes."""
    write_ball(tmp_path / "ball.ply", 60, 60, 0.2)
    whole = voxkernel.voxel_kernel(tmp_path / "ball.ply", **options)
    kept = []
    gather = streamed_rows.planes_for_voxels

    def counted(*arguments):
        kept.append(gather(*arguments))
        return kept[-1]

    monkeypatch.setattr(sys.modules["voxkernel.voxels.voxel_kernel"], "planes_for_voxels", counted)
    if how == "nearest":
        monkeypatch.setattr(streamed_rows, "_FEW", 10)
    if how == "none":
        monkeypatch.setattr(streamed_rows, "_centers", lambda *_: None)
    found = voxkernel.voxel_kernel(voxkernel.stream_mesh(tmp_path / "ball.ply", chunk_facets=999), **options)
    assert found.to_dict() == whole.to_dict()
    for one, other in ((found.inside, whole.inside), (found.boundary, whole.boundary)):
        np.testing.assert_array_equal(one.to_ijk(), other.to_ijk())
    if how != "none":
        assert len(kept[0]) < 200  # of 7,080, before 447 to 1,127


def test_axes_of_the_surface_are_refused():
    surface = voxkernel.stream_mesh(STAR)
    with pytest.raises(ValueError, match="`frame` must be 'world' for a streamed surface; got 'principal'"):
        voxkernel.voxel_kernel(surface, frame="principal")
