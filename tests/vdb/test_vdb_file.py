import dataclasses
import os
import struct
import sys

import numpy as np
import pytest
from grids import random_frame, random_grid, with_inactive_tiles
from hypothesis import given, settings
from hypothesis import strategies as st

from voxkernel.errors import GridReadError, MissingExtraError, VoxKernelError
from voxkernel.grid import SparseGrid
from voxkernel.vdb import file_format, node_values, read_vdb, write_vdb
from voxkernel.vdb.file_format import pack_map, pack_metadata, pack_text

seeds = st.integers(0, 2**32)


def same_values(one, two):
    """Also the inactive values of leaves and tiles, which `==` does not look at."""
    box = [[-40] * 3, [40] * 3]
    return np.array_equal(one.to_dense(box), two.to_dense(box), equal_nan=True)


def make_grid(seed, *, has_values):
    grid = random_grid(seed, has_values=has_values, n_cells=20, background=-1.5 if seed % 2 else 0.0)
    if has_values:
        grid = with_inactive_tiles(grid, seed)
    return dataclasses.replace(grid, **random_frame(seed))


def written(tmp_path, grids, metadata=None, **options):
    path = tmp_path / "grid.vdb"
    write_vdb(path, grids, metadata=metadata, **options)
    return path


# -- round trips ---------------------------------------------------------------


@settings(max_examples=40)
@given(seeds, st.sampled_from(["bool", "mask"]))
def test_masks_survive_a_round_trip(tmp_path_factory, seed, value_type):
    grid = make_grid(seed, has_values=False)
    file = read_vdb(written(tmp_path_factory.mktemp("vdb"), grid, value_type=value_type))
    assert file[0] == grid
    assert file[0].is_mask
    assert file.value_types == (value_type,)
    assert file[0].leaf_count == grid.leaf_count


@settings(max_examples=40)
@given(seeds, st.sampled_from(["none", "zip", "blosc"]))
def test_values_survive_a_round_trip(tmp_path_factory, seed, compression):
    grid = make_grid(seed, has_values=True)
    file = read_vdb(written(tmp_path_factory.mktemp("vdb"), grid, compression=compression))
    assert file[0] == grid
    assert file[0].background == grid.background
    assert file.value_types == ("float",)
    assert same_values(file[0], grid)


@settings(max_examples=20)
@given(seeds)
def test_a_mask_as_fog_has_ones(tmp_path_factory, seed):
    grid = make_grid(seed, has_values=False)
    read = read_vdb(written(tmp_path_factory.mktemp("vdb"), grid, value_type="float"))[0]
    assert read.to_mask() == grid
    assert (read.values_at(read.to_ijk()) == 1).all()
    assert read.background == 0


def test_half_precision_rounds_to_half(tmp_path, rng):
    values = rng.normal(size=600).astype(np.float32)
    ijk = np.unique(rng.integers(-30, 30, (600, 3)), axis=0)
    grid = SparseGrid.from_ijk(ijk, values=values[: len(ijk)], background=0.1)
    file = read_vdb(written(tmp_path, grid, value_type="half"))
    assert file.value_types == ("half",)
    assert file[0].background == np.float32(np.float16(0.1))
    np.testing.assert_array_equal(file[0].values_at(ijk), values[: len(ijk)].astype(np.float16).astype(np.float32))


def test_every_mode_of_inactive_values_survives(tmp_path, rng):
    background = 3.0
    minus = -background
    choices = [
        [background], [minus], [7], [background, minus], [background, 7], [7, 8], [7, minus], [7, 8, 9],
        [np.nan], [-0.0, 0.0], [np.inf, background, minus],
    ]  # fmt: skip
    leaf_values = np.stack([rng.choice(np.array(c, dtype=np.float32), 512) for c in choices])
    corners = np.arange(len(choices))[:, None] * [8, 0, 0]
    masks = rng.integers(0, 2**64, (len(choices), 8), np.uint64)
    values = {"tile_values": [], "leaf_values": leaf_values, "background": background}
    grid = SparseGrid.from_tiles_and_leaves([], [], corners, masks, **values)
    modes = set()
    kept = node_values._read_inactive

    def spy(*arguments):
        result = kept(*arguments)
        modes.add(result[0])
        return result

    for compression in ("none", "zip", "blosc"):
        path = written(tmp_path, grid, compression=compression)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(node_values, "_read_inactive", spy)
            read = read_vdb(path)[0]
        np.testing.assert_array_equal(read.leaf_values.view(np.uint32), grid.leaf_values.view(np.uint32))
    assert modes == set(range(7))


def test_tiles_of_all_sizes_are_split_to_those_of_openvdb(tmp_path):
    corners = [
        [-(2**13), 0, 0],
        [2**12, 0, 0],
        [0, 2**12, 0],
        [128, 0, 0],
        [64, 0, 0],
        [0, -8, 0],
        [0, 0, -1024],
    ]
    grid = SparseGrid.from_tiles_and_leaves(corners, [13, 12, 10, 7, 6, 3, 8], [], [])
    read = read_vdb(written(tmp_path, grid))[0]
    assert read == grid
    assert np.unique(read.tile_log2, return_counts=True)[0].tolist() == [3, 7, 12]
    assert read.tile_count == 8 + 1 + 512 + 1 + 512 + 1 + 8
    assert read.prune().tile_count == len(corners)


def test_tiles_too_large_to_split_are_refused(tmp_path):
    grid = SparseGrid.from_tiles_and_leaves([[0, 0, 0]], [23], [], [])
    with pytest.raises(ValueError, match="`grids` must have fewer large tiles"):
        write_vdb(tmp_path / "a.vdb", grid)
    assert list(tmp_path.iterdir()) == []


def test_the_ends_of_the_range_survive(tmp_path):
    grid = SparseGrid.from_ijk([[-(2**23)] * 3, [2**23 - 1] * 3, [-1, 0, -1]])
    assert read_vdb(written(tmp_path, grid))[0] == grid


def test_empty_grids_and_no_grids(tmp_path):
    file = read_vdb(written(tmp_path, {"a": SparseGrid.from_ijk([]), "b": SparseGrid.from_dense(np.zeros((2, 2, 2)))}))
    assert file.names == ("a", "b")
    assert file["a"] == SparseGrid.from_ijk([])
    assert file["b"].active_voxel_count == 0
    assert len(read_vdb(written(tmp_path, []))) == 0


# -- metadata, names, transforms ------------------------------------------------------


def test_metadata_keeps_its_types(tmp_path):
    entries = {
        "volume_lower": 1.25,
        "n_facets": 11522,
        "big": -(2**62),
        "source": "Gesicht ü.ply",
        "closed": True,
        "vector": (1, 2, 3),
        "centre": (0.5, -1.0, 2.0),
        "pair": (1, 2),
        "four": (1.0, 2.0, 3.0, 4.0),
        "far": (2**40, 0, 0),
        "matrix": tuple(float(n) for n in range(16)),
        "numpy": np.float64(2.5),
        "array": np.array([1, 2, 3]),
    }
    grid = dataclasses.replace(SparseGrid.from_ijk([[0, 0, 0]]), metadata=entries)
    file = read_vdb(written(tmp_path, grid, entries))
    expected = entries | {"far": (2.0**40, 0.0, 0.0), "numpy": 2.5, "array": (1, 2, 3)}
    for found in (file.metadata, file[0].metadata):
        assert found == expected
        assert {key: type(value) for key, value in found.items()} == {k: type(v) for k, v in expected.items()}


@pytest.mark.parametrize(
    ("entries", "error", "match"),
    [
        ({"a": None}, TypeError, "`metadata` must hold bool, int, float, str"),
        ({"a": (1, 2, 3, 4, 5)}, TypeError, "`metadata` must hold"),
        ({"a": [("b",)]}, TypeError, "`metadata` must hold"),
        ({1: 2}, TypeError, "`metadata` must have str keys; got int"),
        ({"a": 2**63}, ValueError, "`metadata` must hold integers of 64 bits"),
    ],
)
def test_metadata_without_a_type_is_refused(tmp_path, entries, error, match):
    with pytest.raises(error, match=match):
        write_vdb(tmp_path / "a.vdb", SparseGrid.from_ijk([[0, 0, 0]]), metadata=entries)
    assert list(tmp_path.iterdir()) == []


def test_grids_of_one_name_are_kept_apart(tmp_path):
    grids = [SparseGrid.from_ijk([[n, 0, 0]], name=name) for n, name in enumerate(["a", "a", "", "", "a"])]
    file = read_vdb(written(tmp_path, grids))
    assert file.names == ("a", "a", "", "", "a")
    assert [grid.active_bbox[0, 0] for grid in file] == [0, 1, 2, 3, 4]
    assert file["a"] == grids[0]
    assert repr(file) == "VdbFile('a', 'a', '', '', 'a')"
    with pytest.raises(KeyError, match="no grid is named 'c'"):
        file["c"]


@pytest.mark.parametrize("grid_class", ["unknown", "level set", "fog volume", "staggered"])
def test_classes_survive(tmp_path, grid_class):
    grid = dataclasses.replace(SparseGrid.from_ijk([[0, 0, 0]], values=[1]), grid_class=grid_class)
    assert read_vdb(written(tmp_path, grid))[0].grid_class == grid_class


def test_the_origin_is_exact_unless_another_program_moved_the_grid(tmp_path):
    grid = SparseGrid.from_ijk([[0, 0, 0]], origin=(0.1, 0.2, 0.3), voxel_size=1 / 3)
    path = written(tmp_path, grid)
    assert read_vdb(path)[0].origin.tolist() == [0.1, 0.2, 0.3]
    raw = path.read_bytes()
    shift = struct.pack("<d", 0.1 + 1 / 6)
    assert raw.count(shift) == 1
    path.write_bytes(raw.replace(shift, struct.pack("<d", 5.0)))
    assert read_vdb(path)[0].origin[0] == pytest.approx(5 - 1 / 6)


def test_the_same_input_gives_the_same_bytes(tmp_path):
    grid = make_grid(5, has_values=True)
    assert written(tmp_path, grid).read_bytes() == written(tmp_path, grid).read_bytes()


# -- files of others ------------------------------------------------------------------


def test_bool_grids_with_false_active_voxels_become_numbers(tmp_path):
    path = written(tmp_path, SparseGrid.from_ijk([[0, 0, 0], [0, 0, 1]]))
    raw = bytearray(path.read_bytes())
    assert raw[-64] == 3
    raw[-64] = 6  # the leaf's values: active (0, 0, 0) false, inactive (0, 0, 2) true
    path.write_bytes(raw)
    grid = read_vdb(path)[0]
    assert grid.values_at([[0, 0, 0], [0, 0, 1], [0, 0, 2], [0, 0, 3]]).tolist() == [0, 1, 1, 0]
    assert grid.is_active([[0, 0, 0], [0, 0, 2]]).tolist() == [True, False]


def test_grids_of_unknown_type_are_skipped_and_named(tmp_path):
    grids = [SparseGrid.from_ijk([[n, 0, 0]], name=f"g{n}") for n in range(3)]
    path = written(tmp_path, grids)
    raw = path.read_bytes()
    at = raw.index(b"Tree_bool_5_4_3", raw.index(b"g1"))
    path.write_bytes(raw[:at] + b"Tree_vc3s_5_4_3" + raw[at + 15 :])
    with pytest.warns(UserWarning, match=r"skipped 'g1' \(Tree_vc3s_5_4_3\)"):
        file = read_vdb(path)
    assert file.names == ("g0", "g2")
    assert file.skipped == ("'g1' (Tree_vc3s_5_4_3)",)
    assert repr(file) == "VdbFile('g0', 'g2', 1 skipped)"
    at = raw.index(b"UniformScaleTranslateMap")
    path.write_bytes(raw[:at] + b"NonlinearFrustumMapOther" + raw[at + 24 :])
    with pytest.warns(UserWarning, match=r"'g0' \(transform 'NonlinearFrustumMapOther'\)"):
        assert read_vdb(path).names == ("g1", "g2")


def test_streams_without_offsets_are_read_in_order(tmp_path):
    path = written(tmp_path, [make_grid(n, has_values=bool(n % 2)) for n in range(4)])
    expected = read_vdb(path)
    raw = bytearray(path.read_bytes())
    assert raw[16 + 4] == 1  # magic 8, version 4, library 8: the offset flag
    raw[20] = 0
    path.write_bytes(raw)
    assert list(read_vdb(path)) == list(expected)


def test_grids_can_share_a_tree(tmp_path):
    grids = [SparseGrid.from_ijk([[0, 0, 5]], name="a"), SparseGrid.from_ijk([], name="b")]
    raw = written(tmp_path, grids).read_bytes()
    at = raw.index(b"\x01\0\0\0b\x0f\0\0\0Tree_bool") + 4 + 1 + 4 + 15
    head = raw[:at] + struct.pack("<I", 1) + b"a"
    tail_at = at + 4 + 24
    block_at = struct.unpack("<q", raw[at + 4 + 8 : at + 4 + 16])[0]
    body = raw[tail_at : block_at - 4 - 1 - 8]  # flags, metadata, transform; no tree
    start = len(head) + 24
    end = start + len(body)
    path = tmp_path / "shared.vdb"
    path.write_bytes(head + struct.pack("<qqq", start, end, end) + body)
    assert read_vdb(path)["b"] == grids[0]
    path.write_bytes(head[:-1] + b"z" + struct.pack("<qqq", start, end, end) + body)
    with pytest.raises(GridReadError, match="must share the tree of a grid before it; got 'z'"):
        read_vdb(path)


@pytest.mark.parametrize(
    ("kind", "numbers", "expected"),
    [
        ("ScaleMap", [1, 2, 3] + [0] * 12, np.diag([1, 2, 3, 1])),
        ("UniformScaleMap", [2, 2, 2] + [0] * 12, np.diag([2, 2, 2, 1])),
        ("TranslationMap", [4, 5, 6], [[1, 0, 0, 4], [0, 1, 0, 5], [0, 0, 1, 6], [0, 0, 0, 1]]),
        ("UnitaryMap", [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
         [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]),
    ],
)  # fmt: skip
def test_all_linear_maps_are_known(kind, numbers, expected):
    raw = file_format.pack_text(kind) + struct.pack(f"<{len(numbers)}d", *numbers)
    np.testing.assert_array_equal(file_format.read_map(file_format.Source(raw)), expected)


# -- damaged and hostile files ----------------------------------------------------------


def test_missing_and_foreign_files(tmp_path):
    with pytest.raises(GridReadError, match="`path` must be an existing file") as caught:
        read_vdb(tmp_path / "missing.vdb")
    assert isinstance(caught.value, OSError | VoxKernelError)
    for content in (b"", b"solid", b"x" * 100):
        (tmp_path / "foreign.vdb").write_bytes(content)
        with pytest.raises(GridReadError, match=r"`path` must be a .vdb file; got another magic number"):
            read_vdb(tmp_path / "foreign.vdb")


@pytest.mark.parametrize("version", [0, 221, 226, 2**32 - 1])
def test_other_versions_are_refused(tmp_path, version):
    path = written(tmp_path, [])
    raw = path.read_bytes()
    path.write_bytes(raw[:8] + struct.pack("<I", version) + raw[12:])
    with pytest.raises(GridReadError, match=rf"the file version must be in 222..225; got {version}"):
        read_vdb(path)


@pytest.mark.parametrize("has_values", [False, True])
def test_every_truncation_is_noticed(tmp_path, has_values):
    path = written(tmp_path, make_grid(3, has_values=has_values), compression="zip")
    raw = path.read_bytes()
    cuts = np.unique(np.concatenate([np.arange(400), np.linspace(400, len(raw) - 1, 150, dtype=int)]))
    for cut in cuts[cuts < len(raw)]:
        path.write_bytes(raw[:cut])
        with pytest.raises(GridReadError):
            read_vdb(path)


def patched(path, raw, at, fmt, value):
    changed = bytearray(raw)
    struct.pack_into("<" + fmt, changed, at, value)
    path.write_bytes(changed)


def test_hostile_counts_and_offsets_are_refused_at_once(tmp_path):
    path = written(tmp_path, SparseGrid.from_ijk([[0, 0, 0]], name="grid-name"))
    raw = path.read_bytes()
    n_metadata, n_grids = 57, 61
    title = raw.index(b"grid-name") - 4
    offsets = title + 4 + 9 + 4 + 15 + 4
    grid_at = offsets + 24
    root = raw.index(b"UniformScaleTranslateMap") + 24 + 144
    for at, fmt, value, match in [
        (n_metadata, "I", 2**32 - 1, "4294967295 metadata entries needs"),
        (n_grids, "i", 2**31 - 1, "2147483647 grids needs"),
        (n_grids, "i", -1, "-1 grids needs"),
        (title, "I", 2**32 - 1, "the name of a grid needs 4294967295"),
        (offsets, "q", -1, "the offsets of grid 'grid-name' must lie in"),
        (offsets, "q", 2**62, "the offsets of grid"),
        (offsets, "q", 8, "the offsets of grid"),
        (offsets + 8, "q", 12, "the buffers of a grid must begin at byte 12"),
        (offsets + 16, "q", 2**62, "the offsets of grid"),
        (offsets + 16, "q", grid_at, "compression flags needs"),
        (grid_at + 4, "I", 2**31, "2147483648 metadata entries needs"),
        (root, "i", 2, "a tree must have 1 buffer; got 2"),
        (root + 5, "I", 2**32 - 1, "4294967295 tiles of the root needs"),
        (root + 9, "I", 2**32 - 1, "4294967295 nodes below the root needs"),
        (root + 13, "i", 5, "root entries must lie at multiples of 4096"),
        (root + 13, "i", -(2**31), "voxels must lie in -8388608..8388607"),
        (root + 13 + 12 + 4096, "B", 255, "a slot of a node must be a child or a tile; got both"),
        (root + 13 + 12 + 8192, "B", 7, r"the mode of a node must be 0..6; got 7"),
    ]:  # fmt: skip
        patched(path, raw, at, fmt, value)
        with pytest.raises(GridReadError, match=match):
            read_vdb(path)


def test_overlapping_cells_and_singular_transforms_are_refused(tmp_path):
    big = SparseGrid.from_tiles_and_leaves([[0, 0, 0], [4096, 0, 0]], [12, 12], [], [])
    path = written(tmp_path, big)
    raw = path.read_bytes()
    at = raw.index(struct.pack("<3i??", 4096, 0, 0, True, True))
    patched(path, raw, at, "i", 0)
    with pytest.raises(GridReadError, match=r"grid '' is damaged: tiles and leaves must not overlap"):
        read_vdb(path)
    at = raw.index(b"UniformScaleTranslateMap") + 24 + 24
    for value, match in ((0.0, "`linear` must be an invertible matrix"), (np.nan, "must be finite")):
        patched(path, raw, at, "d", value)
        with pytest.raises(GridReadError, match=match):
            read_vdb(path)
    turned = written(tmp_path, dataclasses.replace(big, linear=np.eye(3)[[1, 2, 0]]))
    raw = turned.read_bytes()
    patched(turned, raw, raw.index(b"AffineMap") + 9 + 8 * 3, "d", 1.0)
    with pytest.raises(GridReadError, match="an AffineMap must not be projective"):
        read_vdb(turned)


@pytest.mark.parametrize("compression", ["zip", "blosc"])
def test_bombs_and_broken_chunks_are_refused(compression):
    flags = {"zip": 3, "blosc": 6}[compression]

    def read(raw, n_bytes):
        return bytes(node_values._read_chunk(file_format.Source(raw), n_bytes, flags))

    plain = bytes(10_000_000)
    bomb = node_values._write_chunk(plain, flags)
    assert len(bomb) < 100_000
    assert read(bomb, len(plain)) == plain
    for size in (2048, len(plain) - 1, len(plain) + 1):
        with pytest.raises(GridReadError, match=r"must unpack to|must be"):
            read(bomb, size)
    with pytest.raises(GridReadError, match=r"cannot be read|must be"):
        read(bomb[:8] + b"\xff" * (len(bomb) - 8), len(plain))
    with pytest.raises(GridReadError, match="compressed values needs"):
        read(struct.pack("<q", 2**62), 100)
    with pytest.raises(GridReadError, match="a chunk of values must have 100 bytes; got 99"):
        read(struct.pack("<q", -99) + bytes(99), 100)
    with pytest.raises(GridReadError, match="a chunk of values must have 100 bytes; got 0"):
        read(struct.pack("<q", 0), 100)
    if compression == "blosc":
        with pytest.raises(GridReadError, match="must have at least 16 bytes; got 5"):
            read(struct.pack("<q", 5) + bytes(5), 100)
        damaged = bytearray(bomb)
        damaged[8 + 16 :] = b"\xff" * (len(bomb) - 24)
        with pytest.raises(GridReadError, match="Blosc-compressed values cannot be read"):
            read(bytes(damaged), len(plain))


def test_deep_metadata_ends_with_the_file(tmp_path):
    entry = file_format.pack_text("k") + file_format.pack_text("string") + struct.pack("<I", 0)
    path = written(tmp_path, [])
    raw = path.read_bytes()
    path.write_bytes(raw[:57] + struct.pack("<I", 50_000) + entry * 50_000 + raw[61:])
    assert read_vdb(path).metadata == {"k": ""}
    entry = file_format.pack_text("k") + file_format.pack_text("int64") + struct.pack("<I", 3) + b"abc"
    path.write_bytes(raw[:57] + struct.pack("<I", 1) + entry + raw[61:])
    with pytest.raises(GridReadError, match="metadata 'k' must be 8 bytes of int64; got 3"):
        read_vdb(path)


def test_a_missing_blosc_is_named(tmp_path, monkeypatch):
    path = written(tmp_path, SparseGrid.from_dense(np.arange(512.0).reshape(8, 8, 8)), compression="blosc")
    monkeypatch.setitem(sys.modules, "blosc", None)
    with pytest.raises(MissingExtraError, match="`blosc` is not installed; the extra `vdb` brings it"):
        read_vdb(path)


# -- writing -----------------------------------------------------------------------------


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = written(tmp_path, SparseGrid.from_ijk([[0, 0, 0]]))
    before = path.read_bytes()

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        write_vdb(path, SparseGrid.from_ijk([[1, 1, 1]]))
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["grid.vdb"]


def test_wrong_arguments_are_named(tmp_path):
    path = tmp_path / "a.vdb"
    grid = SparseGrid.from_ijk([[0, 0, 0]], values=[1])
    with pytest.raises(TypeError, match="`grids` must be SparseGrid, or several of them; got int"):
        write_vdb(path, 3)
    with pytest.raises(TypeError, match="`grids` must hold SparseGrid only; got str"):
        write_vdb(path, ["a"])
    with pytest.raises(ValueError, match="`value_type` must be one of 'bool', 'mask', 'float', 'half'; got 'double'"):
        write_vdb(path, grid, value_type="double")
    with pytest.raises(ValueError, match="`value_type` must be 'float' or 'half' for a grid with values; got 'bool'"):
        write_vdb(path, grid, value_type="bool")
    with pytest.raises(ValueError, match="`compression` must be one of"):
        write_vdb(path, grid, compression="lz4")
    assert not path.exists()


def test_grids_that_share_a_tree_share_its_arrays(tmp_path):
    """A thousand instances of one tree in a small file must not be a thousand trees in memory."""
    path = tmp_path / "a.vdb"
    ijk = np.argwhere(np.ones((24, 24, 24), dtype=bool))
    first = SparseGrid.from_ijk(ijk, values=np.arange(len(ijk), dtype=np.float32), name="a")
    write_vdb(path, first, compression="none")
    raw = path.read_bytes()
    at = raw.index(struct.pack("<iI", 1, 1) + b"a")
    size = struct.unpack("<I", raw[at + 9 : at + 13])[0]
    kind = raw[at + 13 : at + 13 + size].decode()
    matrix = np.diag([2.0, 2.0, 2.0, 1.0])
    body = struct.pack("<I", 1) + pack_metadata({"class": "fog volume", "k": 7}) + pack_map(matrix)
    out = bytearray(raw[:at] + struct.pack("<i", 1001) + raw[at + 4 :])
    for i in range(1000):
        head = pack_text(f"b{i}") + pack_text(kind) + pack_text("a")
        start = len(out) + len(head) + 24
        out += head + struct.pack("<qqq", start, start + len(body), start + len(body)) + body
    path.write_bytes(out)
    file = read_vdb(path)
    assert file.names == ("a", *(f"b{i}" for i in range(1000)))
    assert file[0] == first
    for grid in file:
        assert np.shares_memory(grid.leaf_values, file[0].leaf_values)
        assert np.shares_memory(grid.leaf_mask, file[0].leaf_mask)
    last = file[1000]
    assert last.grid_class == "fog volume"
    assert last.metadata["k"] == 7
    assert (last.linear == 2 * np.eye(3)).all()
    assert (last.values_at(ijk) == first.values_at(ijk)).all()
    last_head = pack_text("b999") + pack_text(kind)
    path.write_bytes(bytes(out).replace(last_head + pack_text("a"), last_head + pack_text("c")))
    with pytest.raises(GridReadError, match="grid 'b999' must share the tree of a grid before it; got 'c'"):
        read_vdb(path)
