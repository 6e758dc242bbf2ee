"""Our .vdb files read by real OpenVDB, and its files read by us, voxel by voxel.

`adobe-lagrange` (OpenVDB 13) comes from PyPI. Debian's python3-openvdb (OpenVDB 10) runs under the system's Python,
since it needs the system's NumPy: `apt-get install python3-openvdb libopenvdb-tools`. Both run as separate processes.
"""

import dataclasses
import importlib.util
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from grids import random_frame, random_grid, with_inactive_tiles

from voxkernel.grid import SparseGrid
from voxkernel.vdb import read_vdb, write_vdb

PEER = Path(__file__).with_name("openvdb_peer.py")
LAGRANGE_PEER = Path(__file__).with_name("lagrange_peer.py")
BOX = [[-40] * 3, [39] * 3]


# -- Debian's OpenVDB 10 --------------------------------------------------------------


@pytest.fixture(scope="module")
def peer():
    python = shutil.which("python3", path="/usr/bin:/bin")
    probe = python and subprocess.run([python, "-c", "import pyopenvdb"], capture_output=True, check=False)
    if not probe or probe.returncode:
        pytest.skip("pyopenvdb not found under the system's Python; apt-get install python3-openvdb")

    def run(*arguments):
        subprocess.run([python, str(PEER), *map(str, arguments)], check=True)

    return run


@pytest.fixture(scope="module")
def tool():
    path = shutil.which("vdb_tool")
    if not path:
        pytest.skip("vdb_tool not found; apt-get install libopenvdb-tools")
    return path


class Dump:
    """What pyopenvdb said about some files."""

    def __init__(self, path):
        self.arrays = np.load(path)
        self.facts = json.loads(str(self.arrays["facts"]))

    def grids(self, n_file):
        """Facts and arrays of each grid; pyopenvdb sorts grids by name."""
        for n, fact in enumerate(self.facts[n_file]["grids"]):
            names = ("tiles", "tile_values", "voxels", "values", "dense")
            yield (
                fact,
                {k: self.arrays[f"{n_file}.{n}.{k}"] for k in names if f"{n_file}.{n}.{k}" in self.arrays},
            )


def by_name(grids):
    return sorted(grids, key=lambda grid: grid.name)


def assert_same(grid, fact, found):
    """Every active tile, voxel and value, inactive values in a box, and the transform."""
    tiles, voxels = found["tiles"], found["voxels"]
    corners = tiles[:, :3]
    edges = tiles[:, 3:] - corners + 1
    assert (edges == edges[:, :1]).all()
    theirs = SparseGrid.from_ijk(voxels).union(
        SparseGrid.from_tiles_and_leaves(corners, np.log2(edges[:, 0]).astype(np.int8), [], [])
    )
    unplaced = dataclasses.replace(grid.to_mask(), origin=np.zeros(3), linear=np.eye(3))
    assert unplaced == theirs
    assert fact["count"] == grid.active_voxel_count
    if grid.active_bbox is not None:
        np.testing.assert_array_equal(fact["bbox"], grid.active_bbox)
    np.testing.assert_array_equal(grid.values_at(voxels), found["values"])
    np.testing.assert_array_equal(grid.values_at(corners), found["tile_values"])
    np.testing.assert_array_equal(grid.to_dense(BOX), found["dense"])
    np.testing.assert_array_equal(grid.values_at([[10**6, 0, 0]]), np.float32(fact["background"]))
    ijk = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    np.testing.assert_allclose(grid.index_to_world(ijk), fact["frame"], rtol=1e-14, atol=1e-13)
    assert fact["name"] == grid.name
    assert fact["class"] == grid.grid_class


@pytest.fixture(scope="module")
def ours(tmp_path_factory, peer):
    """Files we write, and what OpenVDB reads in them: one process for all."""
    folder = tmp_path_factory.mktemp("ours")
    sphere = read_level_set()
    cases = []
    for seed in range(8):
        has_values = seed % 2 == 1
        grid = random_grid(seed, has_values=has_values, n_cells=30, background=-1.5 if seed % 4 == 3 else 0.0)
        if has_values:
            grid = with_inactive_tiles(grid, seed)
        grid = dataclasses.replace(grid, **random_frame(seed), name=f"grid {seed}", metadata={"alpha": 0.1 * seed})
        compression = ("none", "zip", "blosc")[seed % 3]
        cases.append(([grid], {"compression": compression}))
    tiles = SparseGrid.from_tiles_and_leaves(
        [[-8192, 0, 0], [4096, 0, 0], [0, 4096, 0], [128, 0, 0], [64, 0, 0], [0, -8, 0], [0, 0, -1024]],
        [13, 12, 10, 7, 6, 3, 8],
        [[-8, -8, -8]],
        np.array([[1, 2, 3, 4, 5, 6, 7, 2**63]], dtype=np.uint64),
    )
    cases += [
        ([tiles], {}),
        ([tiles], {"value_type": "float"}),
        ([cases[1][0][0]], {"value_type": "half"}),
        ([cases[3][0][0]], {"value_type": "half", "compression": "blosc"}),
        ([sphere], {"compression": "zip"}),
        ([cases[0][0][0], cases[1][0][0], tiles], {}),
        ([SparseGrid.from_ijk([]), SparseGrid.from_dense(np.zeros((1, 1, 1)))], {}),
    ]
    metadata = {"author": "us", "n": 7, "x": 0.25, "yes": True, "v": (1, 2, 3), "w": (0.5, 1.0, 2.0)}
    paths = []
    for n, (grids, options) in enumerate(cases):
        paths.append(folder / f"{n}.vdb")
        write_vdb(paths[-1], grids, metadata=metadata, **options)
    peer("dump", folder / "out.npz", *paths)
    return cases, Dump(folder / "out.npz"), metadata


def read_level_set():
    """A sphere with a narrow band: inside and outside are inactive tiles and voxels of -3 and 3."""
    at = np.indices((40, 40, 40)).reshape(3, -1).T - 20
    distance = np.clip(np.linalg.norm(at, axis=1) - 17.0, -3, 3).astype(np.float32)
    band = np.abs(distance) < 3
    grid = SparseGrid.from_ijk(at[band], values=distance[band], background=3.0, voxel_size=0.5, name="sphere")
    dense = np.full((40, 40, 40), 3, dtype=np.float32)
    dense[tuple((at + 20).T)] = distance
    leaf_values = grid.leaf_values.copy()
    for row, corner in enumerate(grid.leaf_ijk):
        cells = np.indices((8, 8, 8)).reshape(3, -1).T + corner
        inside = np.linalg.norm(cells, axis=1) < 14
        leaf_values[row, inside] = -3
    return dataclasses.replace(
        grid,
        leaf_values=leaf_values,
        grid_class="level set",
        inactive_ijk=[[-8, -8, -8], [0, 0, 0]],
        inactive_log2=[3, 3],
        inactive_values=[-3, -3],
    )


def test_openvdb_reads_what_we_write(ours):
    cases, dump, metadata = ours
    for n, (grids, options) in enumerate(cases):
        assert {key: value for key, value in dump.facts[n]["metadata"].items()} == {
            key: list(value) if isinstance(value, tuple) else value for key, value in metadata.items()
        }
        for grid, (fact, found) in zip(by_name(grids), dump.grids(n), strict=True):
            kind = options.get("value_type") or ("bool" if grid.is_mask else "float")
            assert fact["type"] == ("bool" if kind == "bool" else "float")
            assert fact["half"] == (kind == "half")
            expected = in_half(grid) if kind == "half" else grid
            if kind == "float" and grid.is_mask:
                found["dense"] = found["dense"] == 1
            assert_same(expected, fact, found)
            assert fact["leaves"] == grid.leaf_count
            assert fact["metadata"]["file_voxel_count"] == grid.active_voxel_count
            for key, value in grid.metadata.items():
                assert fact["metadata"][key] == value


def in_half(grid):
    def rounded(values):
        return values.astype(np.float16).astype(np.float32)

    return dataclasses.replace(
        grid,
        background=float(np.float16(grid.background)),
        tile_values=rounded(grid.tile_values),
        leaf_values=rounded(grid.leaf_values),
        inactive_values=rounded(grid.inactive_values),
    )


@pytest.fixture(scope="module")
def theirs(tmp_path_factory, peer):
    folder = tmp_path_factory.mktemp("theirs")
    peer("make", folder)
    return folder


def compare(paths, out):
    dump = Dump(out)
    n_grids = 0
    for n, path in enumerate(paths):
        file = read_vdb(path)
        facts = [pair for pair in dump.grids(n) if "dense" in pair[1]]
        for grid, (fact, found) in zip(by_name(file), facts, strict=True):
            if grid.is_mask is False and fact["type"] == "bool":
                found["dense"] = found["dense"].astype(np.float32)
            assert_same(grid, fact, found)
            for key, value in grid.metadata.items():
                listed = list(value) if isinstance(value, tuple) else value
                assert fact["metadata"][key] == listed
            n_grids += 1
        plain = {key: list(value) if isinstance(value, tuple) else value for key, value in file.metadata.items()}
        assert plain == dump.facts[n]["metadata"]
    return n_grids


@pytest.mark.filterwarnings("ignore:.*skipped '' .Tree_vec3s_5_4_3.:UserWarning")
def test_we_read_what_openvdb_writes(theirs, peer, tmp_path):
    paths = sorted(theirs.glob("*.vdb"))
    peer("dump", tmp_path / "out.npz", *paths)
    assert compare(paths, tmp_path / "out.npz") == 13


def test_the_files_of_openvdb_are_of_the_kinds_wanted(theirs):
    level_set = read_vdb(theirs / "level_set.vdb")[0]
    assert level_set.grid_class == "level set"
    assert len(level_set.inactive_ijk) > 0  # inside
    assert level_set.values_at(np.round(level_set.world_to_index([[1, -2, 0.5]])).astype(int)) == -level_set.background
    several = read_vdb(theirs / "several.vdb")
    assert several.value_types == ("half", "float", "bool", "float")
    tiles = read_vdb(theirs / "bool_tiles.vdb")[0]
    assert (tiles.tile_log2 == 12).sum() == 3  # root tiles
    assert tiles.active_bbox[0].min() == -8192
    assert (tiles.linear != np.diag(np.diag(tiles.linear))).any()
    with pytest.warns(UserWarning, match="Tree_vec3s_5_4_3"):
        assert len(read_vdb(theirs / "vectors.vdb").skipped) == 1


@pytest.mark.parametrize("codec", ["none", "zip", "blosc", "active"])
def test_we_read_every_codec_of_openvdb(theirs, peer, tool, tmp_path, codec):
    paths = []
    for name in ("float_field", "level_set", "several"):
        for bits in (16, 32):
            path = tmp_path / f"{name}_{bits}.vdb"
            arguments = [
                "-read",
                str(theirs / f"{name}.vdb"),
                "-write",
                f"codec={codec}",
                f"bits={bits}",
                str(path),
            ]
            subprocess.run([tool, *arguments], check=True, capture_output=True)
            paths.append(path)
    peer("dump", tmp_path / "out.npz", *paths)
    assert compare(paths, tmp_path / "out.npz") >= 6
    flags = {int.from_bytes(flag_bytes(path.read_bytes()), "little") for path in paths}
    assert {"none": 0, "zip": 3, "blosc": 6, "active": 2}[codec] in flags


def flag_bytes(raw):
    """Compression flags of the first grid."""
    at = raw.index(b"_5_4_3") + 6
    at = raw.index(b"_HalfFloat", at) + 10 if raw[at : at + 10] == b"_HalfFloat" else at
    return raw[at + 28 : at + 32]


def test_what_we_read_and_write_again_is_unchanged_for_openvdb(theirs, peer, tmp_path):
    paths = []
    for path in sorted(theirs.glob("*.vdb")):
        if path.stem not in ("vectors", "bool_odd"):
            paths.append(tmp_path / path.name)
            file = read_vdb(path)
            write_vdb(paths[-1], file, metadata=file.metadata)
    peer("dump", tmp_path / "out.npz", *paths)
    originals = [read_vdb(theirs / path.name) for path in paths]
    dump = Dump(tmp_path / "out.npz")
    for n, file in enumerate(originals):
        for grid, (fact, found) in zip(by_name(file), dump.grids(n), strict=True):
            assert_same(grid, fact, found)


def test_vdb_print_describes_our_file(tmp_path):
    printer = shutil.which("vdb_print")
    if not printer:
        pytest.skip("vdb_print not found; apt-get install libopenvdb-tools")
    grid = SparseGrid.from_tiles_and_leaves(
        [[0, 0, 0]], [7], [[-8, 0, 0]], np.array([[1] * 8], np.uint64), voxel_size=0.5, name="kernel"
    )
    write_vdb(tmp_path / "a.vdb", dataclasses.replace(grid, metadata={"alpha": 0.03}))
    shown = subprocess.run([printer, "-l", str(tmp_path / "a.vdb")], capture_output=True, text=True, check=True)
    for line in (
        "Name: kernel",
        "Type: Tree_bool_5_4_3",
        "Number of active voxels:       2,097,160",
        "Number of active tiles:        1",
        "Bounding box of active voxels: [-8, 0, 0] -> [127, 127, 127]",
        "alpha: 0.03",
        "voxel size: 0.5",
    ):
        assert line in shown.stdout, shown.stdout


# -- adobe-lagrange, OpenVDB 13 ------------------------------------------------------------


@pytest.fixture(scope="module")
def lagrange():
    if importlib.util.find_spec("lagrange") is None:
        pytest.skip("adobe-lagrange is not installed; pip install adobe-lagrange")

    def run(*arguments):
        subprocess.run([sys.executable, str(LAGRANGE_PEER), *map(str, arguments)], check=True)

    return run


def test_lagrange_reads_what_we_write(lagrange, tmp_path):
    cases = []
    for seed in range(6):
        for value_type in ("bool", "mask", "float", "half"):
            has_values = value_type in ("float", "half")
            grid = random_grid(seed, has_values=has_values, n_cells=30, background=0.5 if has_values else 0.0)
            grid = dataclasses.replace(grid, **random_frame(seed), name=f"kernel {seed}")
            path = tmp_path / f"{seed}_{value_type}.vdb"
            write_vdb(path, grid, value_type=value_type, compression=("none", "zip", "blosc")[seed % 3])
            cases.append((path, grid))
    lagrange("dump", tmp_path / "out.npz", *(path for path, _ in cases))
    found = np.load(tmp_path / "out.npz")
    cells = np.indices((80, 80, 80)).reshape(3, -1).T - 40
    for n, (fact, (_, grid)) in enumerate(zip(json.loads(str(found["facts"])), cases, strict=True)):
        assert fact["count"] == grid.active_voxel_count
        assert fact["name"] == grid.name
        np.testing.assert_array_equal(fact["bbox"], grid.active_bbox)
        np.testing.assert_allclose(fact["transform"], grid.transform, rtol=1e-14, atol=1e-14)
        if not grid.is_mask:
            assert fact["background"] == grid.background
            np.testing.assert_array_equal(found[str(n)], grid.values_at(cells))


@pytest.fixture(scope="module")
def of_lagrange(tmp_path_factory, lagrange):
    folder = tmp_path_factory.mktemp("lagrange")
    lagrange("make", folder)
    return folder, np.load(folder / "made.npz")


@pytest.mark.parametrize("compression", ["Uncompressed", "Zip", "Blosc"])
def test_we_read_points_of_lagrange(of_lagrange, compression):
    folder, made = of_lagrange
    file = read_vdb(folder / f"points_{compression}.vdb")
    assert file.version >= 224
    assert file.names == ("points",)
    expected = SparseGrid.from_ijk(made["cells"], values=made["values"])
    assert dataclasses.replace(file[0], origin=np.zeros(3)) == expected  # theirs: index 0 is a centre at world 0
    np.testing.assert_allclose(file[0].transform, json.loads(str(made["facts"]))["points"]["transform"])


@pytest.mark.parametrize("compression", ["Uncompressed", "Zip", "Blosc"])
def test_we_read_level_sets_of_lagrange(of_lagrange, compression):
    folder, made = of_lagrange
    fact = json.loads(str(made["facts"]))["level_set"]
    grid = read_vdb(folder / f"level_set_{compression}.vdb")[0]
    assert grid.grid_class == "level set"
    assert grid.active_voxel_count == fact["count"]
    np.testing.assert_array_equal(grid.active_bbox, fact["bbox"])
    np.testing.assert_allclose(grid.transform, fact["transform"], rtol=1e-14)
    assert grid.background == fact["background"]
    values = grid.values_at(np.indices((80, 80, 80)).reshape(3, -1).T - 40)
    np.testing.assert_array_equal(values, made["level_set"])
    assert (values == -grid.background).any()
