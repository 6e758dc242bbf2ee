"""Star-shaped pieces: closed, their guard in the exact kernel, and together all that is certified."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.demo_shapes import torus

MESHES = {
    "torus": torus(n_major=24, n_minor=12),
    "two boxes": voxkernel.as_mesh(shapes.two_boxes()),
    "polycube": voxkernel.as_mesh(shapes.voxel_surface([(0, 0, 0), (1, 0, 0), (1, 1, 0), (2, 1, 0), (2, 1, 1)])),
    "open": voxkernel.as_mesh(shapes.height_field(lambda x, y: 0.2 * np.sin(9 * x) * np.cos(7 * y), 12)),
    "crossing": voxkernel.as_mesh(shapes.joined(shapes.box((0, 0, 0), (2, 2, 2)), shapes.box((1, 1, 1), (3, 3, 3)))),
}


@pytest.fixture(scope="module", params=MESHES)
def cover(request):
    return voxkernel.star_cover(voxkernel.guards(MESHES[request.param], coverage=0.9, max_guards=4))


def test_each_piece_is_closed_and_its_kernel_holds_the_guard(cover):
    assert cover.verify()
    for piece in cover.pieces:
        assert piece.mesh.facts().is_closed
        assert piece.mesh.facts().is_outward
        kernel = piece.kernel()
        assert kernel.dimension >= 0
        assert kernel.certificate.verify()
        assert kernel.contains(piece.point[None])[0]


def test_pieces_hold_all_that_is_certified_and_what_is_left_is_listed(cover):
    found = cover.guards
    assert sum(p.area_share for p in cover.pieces) == pytest.approx(found.certified, abs=1e-9)
    areas = found.mesh.facet_areas
    left = (areas[cover.left_faces] * cover.left_shares).sum() / areas.sum()
    assert left == pytest.approx(1.0 - found.certified, abs=1e-9)
    assert sum(len(p.faces) for p in cover.pieces) == len(found.parts)
    for piece in cover.pieces:
        n = len(piece.faces)
        corners = piece.mesh.vertices[piece.mesh.faces]
        size = np.linalg.norm(np.cross(corners[:n, 1] - corners[:n, 0], corners[:n, 2] - corners[:n, 0]), axis=1) / 2
        assert size.sum() / areas.sum() == pytest.approx(piece.area_share, rel=1e-9)
        assert (np.linalg.norm(corners[n:] - piece.point, axis=2).min(axis=1) == 0).all()  # walls end at the guard


def test_volumes_of_pieces_are_those_of_their_hulls(cover):
    for piece in cover.pieces:
        corners = piece.mesh.vertices[piece.mesh.faces[: len(piece.faces)]] - piece.point
        volume = np.linalg.det(corners).sum() / 6.0
        assert volume > 0.0
        assert piece.mesh.volume == pytest.approx(volume, rel=1e-9)


def test_files(cover, tmp_path):
    cover.write(tmp_path / "pieces")
    names = sorted(p.name for p in (tmp_path / "pieces").iterdir())
    assert names == [f"piece_{p.guard:03d}.ply" for p in cover.pieces]
    again = voxkernel.as_mesh(tmp_path / "pieces" / names[0])
    assert np.array_equal(again.vertices, cover.pieces[0].mesh.vertices)
    cover.write(tmp_path / "all.ply")
    whole = voxkernel.as_mesh(tmp_path / "all.ply")
    assert len(whole.faces) == sum(len(p.mesh.faces) for p in cover.pieces)
    assert b"property uchar red" in (tmp_path / "all.ply").read_bytes()[:500]
    assert cover.to_dict()["pieces"][0]["n_facets"] == len(cover.pieces[0].faces)


def test_only_guards_are_taken():
    with pytest.raises(TypeError, match="`guards` must be Guards; got int"):
        voxkernel.star_cover(3)


def test_no_guards_no_pieces(tmp_path):
    empty = voxkernel.star_cover(voxkernel.guards(shapes.cube(), candidates=[[9, 9, 9]]))
    assert len(empty) == 0
    assert empty.left_shares.tolist() == [1.0] * 12
    empty.write(tmp_path / "none.ply")
