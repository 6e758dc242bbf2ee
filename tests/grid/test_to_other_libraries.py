import dataclasses
import json
import zipfile

import numpy as np
import pytest
from grids import BOX, FULL, LOW, dense_mask, dense_values, random_frame, random_grid, with_inactive_tiles
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from voxkernel.errors import GridReadError
from voxkernel.grid import (
    SparseGrid,
    read_npz,
    to_linear_octree,
    to_open3d_points,
    to_open3d_voxels,
    to_pyvista_cells,
    to_pyvista_image,
    to_surface,
    write_npz,
)
from voxkernel.vdb import write_vdb

seeds = st.integers(0, 2**32)


def turned(seed):
    rng = np.random.default_rng(seed)
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return rotation * np.sign(np.linalg.det(rotation))


# -- .npz -----------------------------------------------------------------------


@settings(max_examples=20)
@given(seeds)
def test_npz_files_survive_a_round_trip(tmp_path_factory, seed):
    mask = dataclasses.replace(random_grid(seed), **random_frame(seed), name="inside")
    field = with_inactive_tiles(random_grid(seed, has_values=True, background=np.inf), seed)
    field = dataclasses.replace(field, grid_class="fog volume", metadata={"alpha": 0.1, "v": (1, 2, 3), "ok": True})
    path = tmp_path_factory.mktemp("npz") / "a.npz"
    write_npz(path, [mask, field])
    again = read_npz(path)
    assert again == (mask, field)
    assert [grid.name for grid in again] == ["inside", ""]
    assert again[1].metadata == field.metadata
    assert again[1].grid_class == "fog volume"
    np.testing.assert_array_equal(again[1].to_dense(BOX), field.to_dense(BOX))


def test_npz_files_are_compact(tmp_path):
    at = np.indices((100, 100, 100), dtype=np.int16).reshape(3, -1).T - 50
    ball = SparseGrid.from_ijk(at[(at.astype(int) ** 2).sum(axis=1) < 48**2])
    write_npz(tmp_path / "a.npz", ball)
    write_vdb(tmp_path / "a.vdb", ball)
    assert (tmp_path / "a.npz").stat().st_size < 0.3 * (tmp_path / "a.vdb").stat().st_size


def test_npz_files_of_others_and_damaged_ones_are_refused(tmp_path):
    path = tmp_path / "a.npz"
    with pytest.raises(GridReadError, match="`path` must be an existing file"):
        read_npz(path)
    grid = SparseGrid.from_ijk([[0, 0, 0], [9, 9, 9]])
    write_npz(path, grid)
    raw = path.read_bytes()
    for content in (b"", b"abc", raw[: len(raw) // 2], raw[:-10]):
        path.write_bytes(content)
        with pytest.raises(GridReadError, match=r"a.npz: `path` must be"):
            read_npz(path)
    np.savez(path, a=np.zeros(3))
    with pytest.raises(GridReadError, match="header"):
        read_npz(path)
    for header, match in (
        ({"format": "other", "version": 1}, "got 'other' of version 1"),
        ({"format": "voxkernel-grid", "version": 2, "grids": []}, "version 1; got 'voxkernel-grid' of version 2"),
        ({"format": "voxkernel-grid", "version": 1, "grids": [{}]}, "metadata"),
        ({"format": "voxkernel-grid", "version": "a\nb", "grids": []}, r"got 'voxkernel-grid' of version 'a\\nb'"),
        ([], "list indices"),
    ):
        np.savez(path, header=np.array(json.dumps(header)))
        with pytest.raises(GridReadError, match=match):
            read_npz(path)


def test_npz_headers_that_promise_too_much_are_refused(tmp_path):
    path = tmp_path / "a.npz"
    write_npz(path, SparseGrid.from_ijk([[0, 0, 0]]))
    with zipfile.ZipFile(path) as archive:
        size = archive.getinfo("0.leaf_mask.npy").file_size
    raw = path.read_bytes()
    at = raw.rindex(b"0.leaf_mask.npy") - 46 + 24
    assert int.from_bytes(raw[at : at + 4], "little") == size
    path.write_bytes(raw[:at] + (2**31).to_bytes(4, "little") + raw[at + 4 :])
    with pytest.raises(GridReadError, match=r".npz file of this library: '0.leaf_mask' promises 2147483648 bytes"):
        read_npz(path)


def test_a_failed_npz_leaves_nothing(tmp_path):
    with pytest.raises(TypeError, match="`grids` must hold SparseGrid only; got int"):
        write_npz(tmp_path / "a.npz", [3])
    with pytest.raises(TypeError, match="JSON"):
        write_npz(tmp_path / "a.npz", dataclasses.replace(SparseGrid.from_ijk([]), metadata={"a": object()}))
    assert list(tmp_path.iterdir()) == []


# -- Open3D and PyVista -------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_open3d_has_the_same_voxels(seed):
    grid = dataclasses.replace(random_grid(seed), origin=(1, 2, 3), linear=turned(seed) * 0.3)
    centres = grid.index_to_world(grid.to_ijk())
    np.testing.assert_array_equal(np.asarray(to_open3d_points(grid).points), centres)
    voxels = to_open3d_voxels(grid)
    cells = np.array([voxel.grid_index for voxel in voxels.get_voxels()])
    assert len(cells) == grid.active_voxel_count
    np.testing.assert_array_equal(np.unique(cells + grid.active_bbox[0], axis=0), np.unique(grid.to_ijk(), axis=0))
    for voxel in cells[:20]:
        place = voxels.get_voxel_center_coordinate(voxel)
        np.testing.assert_allclose(place, grid.index_to_world([voxel + grid.active_bbox[0]])[0], atol=1e-9)
    assert len(to_open3d_voxels(SparseGrid.from_ijk([])).get_voxels()) == 0
    assert len(to_open3d_points(SparseGrid.from_ijk([])).points) == 0


@pytest.mark.parametrize(
    "linear", [np.diag([1, 1, 2.0]), np.diag([1, 1, -1.0]), [[1, 0.5, 0], [0, 0.75**0.5, 0], [0, 0, 1]]]
)
def test_open3d_cannot_hold_other_voxels(linear):
    with pytest.raises(ValueError, match=r"`grid` must have cubic voxels|`voxel_size` must be asked"):
        to_open3d_voxels(SparseGrid.from_ijk([[0, 0, 0]], linear=linear))


@pytest.mark.parametrize("seed", range(3))
def test_pyvista_cells_fill_the_active_volume(seed):
    grid = dataclasses.replace(random_grid(seed, has_values=True), **random_frame(seed))
    cells = to_pyvista_cells(grid)
    assert cells.n_cells == grid.tile_count + grid.active_voxel_count - (8 ** grid.tile_log2.astype(int)).sum()
    assert cells.volume == pytest.approx(grid.active_voxel_count * grid.voxel_volume)
    sizes = cells.compute_cell_sizes(length=False, area=False)["Volume"]
    assert (sizes > 0).all()
    centres = np.array(cells.cell_centers().points)
    ijk = np.floor(grid.world_to_index(centres) + 0.5).astype(int)
    np.testing.assert_array_equal(grid.values_at(ijk), cells["value"])
    np.testing.assert_allclose(sizes, grid.voxel_volume * 8.0 ** cells["log2"], rtol=1e-6)


@pytest.mark.parametrize("has_values", [False, True])
def test_pyvista_images_have_the_same_voxels(has_values):
    grid = random_grid(4, has_values=has_values)
    grid = dataclasses.replace(grid, origin=(1, 2, 3), linear=turned(1) * [0.5, 0.25, 2])
    image = to_pyvista_image(grid)
    centres = np.array(image.cell_centers().points)
    np.testing.assert_allclose(grid.world_to_index(centres), np.round(grid.world_to_index(centres)), atol=1e-4)
    ijk = np.round(grid.world_to_index(centres)).astype(int)
    np.testing.assert_array_equal(image["value" if has_values else "active"], grid.values_at(ijk))
    assert image.n_cells == np.prod(np.diff(grid.active_bbox, axis=0) + 1)
    assert to_pyvista_image(SparseGrid.from_ijk([])).n_cells == 0
    with pytest.raises(ValueError, match="`grid` must have rectangular voxels"):
        to_pyvista_image(dataclasses.replace(grid, linear=[[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]))


def test_large_grids_are_refused_before_they_are_expanded():
    big = SparseGrid.from_tiles_and_leaves([[0, 0, 0]], [20], [[-8, 0, 0]], np.full((1, 8), FULL, dtype=np.uint64))
    with pytest.raises(ValueError, match="`max_voxels` must be at least"):
        to_open3d_points(big)
    with pytest.raises(ValueError, match="`max_voxels` must be at least"):
        to_open3d_voxels(big)
    with pytest.raises(ValueError, match="`max_voxels` must be at least"):
        to_pyvista_image(big)
    with pytest.raises(ValueError, match="`max_cells` must be at least 513; got 10"):
        to_pyvista_cells(big, max_cells=10)
    with pytest.raises(ValueError, match="`max_faces` must be larger for tiles of 17179869184 patches"):
        to_surface(big)
    with pytest.raises(ValueError, match="`max_faces` must be larger for this grid; got 11"):
        to_surface(SparseGrid.from_ijk([[0, 0, 0]]), max_faces=11)


# -- surface -------------------------------------------------------------------------


@settings(max_examples=30)
@given(seeds)
def test_the_surface_is_closed_and_encloses_the_active_volume(seed):
    grid = dataclasses.replace(random_grid(seed), **random_frame(seed))
    vertices, faces = to_surface(grid)
    dense = np.pad(dense_mask(grid), 1)
    n_faces = sum(int((np.diff(dense.astype(np.int8), axis=axis) != 0).sum()) for axis in range(3))
    assert len(faces) == 2 * n_faces
    assert len(np.unique(vertices, axis=0)) == len(vertices)
    assume(len(faces))
    assert set(faces.ravel()) == set(range(len(vertices)))
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    forward = edges[:, 0] * len(vertices) + edges[:, 1]
    backward = edges[:, 1] * len(vertices) + edges[:, 0]
    np.testing.assert_array_equal(np.sort(forward), np.sort(backward))
    corners = (vertices - vertices.mean(axis=0))[faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6
    assert volume == pytest.approx(grid.active_voxel_count * grid.voxel_volume, rel=1e-9)


def test_the_surface_of_a_large_tile_costs_its_surface():
    big = SparseGrid.from_tiles_and_leaves([[-128, 0, 0], [0, 0, 0]], [7, 7], [], [])
    _, faces = to_surface(big)
    assert len(faces) == 2 * 10 * 128**2  # two cubes side by side: the shared side is not shown


def test_the_surface_is_where_it_should_be():
    vertices, faces = to_surface(SparseGrid.from_ijk([[0, 0, 0]], voxel_size=2, origin=(1, 0, 0)))
    assert vertices.min(axis=0).tolist() == [1, 0, 0]
    assert vertices.max(axis=0).tolist() == [3, 2, 2]
    normals = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    outward = vertices[faces].mean(axis=1) - [2, 1, 1]
    assert (np.einsum("ij,ij->i", normals, outward) > 0).all()
    far = SparseGrid.from_ijk([[-(2**23)] * 3, [2**23 - 1] * 3])
    assert len(to_surface(far)[0]) == 16


# -- linear octree ----------------------------------------------------------------------


@settings(max_examples=30)
@given(seeds)
def test_linear_octrees_cover_both_masks(seed):
    inside = random_grid(seed)
    boundary = random_grid(seed + 1).difference(inside)
    octree = to_linear_octree(inside, boundary)
    assert (np.diff(octree.key.astype(np.float64)) > 0).all()
    dense = np.full((64, 64, 64), -1, dtype=np.int8)
    for key, log2, verdict in zip(octree.key.tolist(), octree.log2.tolist(), octree.verdict.tolist(), strict=True):
        assert key % 8**log2 == 0
        ijk = [sum((key >> (3 * bit + 2 - axis) & 1) << bit for bit in range(21)) for axis in range(3)]
        x, y, z = np.array(ijk) + octree.corner - LOW
        edge = 1 << log2
        assert (dense[x : x + edge, y : y + edge, z : z + edge] == -1).all()
        dense[x : x + edge, y : y + edge, z : z + edge] = verdict
    np.testing.assert_array_equal(dense == 1, dense_mask(inside))
    np.testing.assert_array_equal(dense == 0, dense_mask(boundary))


def test_linear_octrees_of_nothing_and_of_too_much():
    empty = SparseGrid.from_ijk([])
    assert len(to_linear_octree(empty).key) == len(to_linear_octree(empty, empty).key) == 0
    with pytest.raises(ValueError, match=r"`inside` must extend over at most 2\*\*21 voxels"):
        to_linear_octree(SparseGrid.from_ijk([[0, 0, 0], [2**22, 0, 0]]))


def test_values_are_not_needed():
    field = random_grid(3, has_values=True)
    assert dense_values(field).any()
    octree = to_linear_octree(field)
    assert int((8 ** octree.log2.astype(np.int64)).sum()) == field.active_voxel_count
