"""Files of grids for the fuzzing: .vdb with each codec, .npz."""

import dataclasses
import io
import json
import struct
import tempfile
import zipfile
import zlib
from functools import cache
from pathlib import Path

import fuzz_mutations as fm
import numpy as np
import shapes
from grids import random_grid, with_inactive_tiles


def _check_grid(grid):
    assert dataclasses.replace(grid) == grid, "a grid that its own checks refuse"
    assert np.isfinite(grid.origin).all(), "an origin that is not finite"
    assert np.isfinite(grid.linear).all(), "axes that are not finite"
    return grid.tile_ijk, grid.tile_log2, grid.leaf_ijk, grid.leaf_mask, grid.origin, grid.linear


def read_vdb_file(path):
    from voxkernel import read_vdb

    return [array for grid in read_vdb(path) for array in _check_grid(grid)]


def read_npz_file(path):
    from voxkernel.grid import read_npz

    return [array for grid in read_npz(path) for array in _check_grid(grid)]


def read_kernel_npz(path):
    from voxkernel.voxels import KernelGrid

    grid = KernelGrid.read(path)
    json.dumps(grid.to_dict())
    return _check_grid(grid.inside) + _check_grid(grid.boundary)


def _sample_grids():
    field = random_grid(2, has_values=True, n_cells=4, background=0.5)
    return random_grid(1, n_cells=5), with_inactive_tiles(field, 3)


@cache
def vdb_seeds(compression):
    from voxkernel import write_vdb

    mask, field = _sample_grids()
    found = []
    kinds = ((mask, None), (mask, "mask"), (field, None), (field, "half"), ([mask, mask], None))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "a.vdb"
        for grid, kind in kinds:
            write_vdb(file, grid, metadata={"alpha": 0.03, "v": (1, 2, 3)}, compression=compression, value_type=kind)
            found.append(file.read_bytes())
    return found


def vdb_fields(data):
    """Where the numbers stand that steer a reader, by a walk of our own; the offsets of grids last."""
    fields, at, jumps = [(8, 4), (20, 1)], 57, []

    def number(fmt="<I"):
        nonlocal at
        fields.append((at, struct.calcsize(fmt)))
        value = struct.unpack_from(fmt, data, at)[0]
        at += struct.calcsize(fmt)
        return value

    def text():
        nonlocal at
        size = number()
        at += size

    def metadata():
        for _ in range(number()):
            text(), text(), text()

    try:
        metadata()
        for _ in range(number("<i")):
            text(), text(), text()
            jumps.append(at)
            fields.extend([(at, 8), (at + 8, 8), (at + 16, 8)])
            end = struct.unpack_from("<q", data, at + 16)[0]
            at += 24
            number()
            metadata()
            text()  # the transform; its numbers and the root of the tree follow
            fields.extend((k, 8) for k in range(at, min(at + 144, len(data) - 8), 8))
            fields.extend((k, 4) for k in range(at + 144, min(at + 300, len(data) - 4), 4))
            at = end
    except struct.error:
        pass
    return fields, jumps


@cache
def vdb_blocks(data):
    """Places of compressed blocks: (start of the size, start, end, codec), found by trying."""
    import blosc

    found, behind = [], 57
    octets = np.frombuffer(data, np.uint8)
    sizes = np.lib.stride_tricks.sliding_window_view(octets, 8).copy().view("<u8")[:, 0]
    for at in np.flatnonzero((sizes > 8) & (sizes < len(data))).tolist():
        start, end = at + 8, at + 8 + int(sizes[at])
        piece = data[start:end]
        if at < behind or end > len(data):
            continue
        try:
            if piece[0] == 0x78:
                zlib.decompress(piece)
                codec = "zip"
            elif piece[0] == 2 and len(piece) >= 16 and int.from_bytes(piece[12:16], "little") == len(piece):
                blosc.decompress(piece)
                codec = "blosc"
            else:
                continue
        except (zlib.error, blosc.error):
            continue
        found.append((at, start, end, codec))
        behind = end
    return found


def damage_vdb(rng, data):
    blocks = vdb_blocks(data)
    if blocks and rng.random() < 0.4:
        return _damage_block(rng, data, rng.choice(blocks))
    fields, jumps = vdb_fields(data)
    sizes = [(block[0], 8) for block in blocks] + [(block[1] + k, 4) for block in blocks for k in (0, 4, 8, 12)]
    return fm.damage_bytes(rng, data, fields + sizes + [(at + 8 * k, 8) for at in jumps for k in range(3)])


def _damage_block(rng, data, block):
    """Damage inside the codec; the block's size and the offsets behind it are put right, or now and then left."""
    import blosc

    size_at, start, end, codec = block
    piece = data[start:end]
    raw = zlib.decompress(piece) if codec == "zip" else blosc.decompress(piece)
    raw = fm.damage_bytes(rng, raw)
    if rng.random() < 0.1:
        raw = bytes(rng.choice((0, 10**5, 10**7)))
    if codec == "zip":
        piece = zlib.compress(raw)
    else:
        codec = rng.choice(("lz4", "blosclz", "zlib"))
        piece = blosc.compress(raw, typesize=rng.choice((1, 4)), cname=codec) if raw else b""
    grown = len(piece) - (end - start)
    out = bytearray(data[:start] + piece + data[end:])
    out[size_at:start] = struct.pack("<q", len(piece) if rng.random() < 0.9 else -len(piece))
    if rng.random() < 0.9:
        for jump in vdb_fields(data)[1]:
            place = jump + (grown if jump > start else 0)
            for k in range(3):
                value = struct.unpack_from("<q", data, jump + 8 * k)[0]
                struct.pack_into("<q", out, place + 8 * k, value + (grown if value > start else 0))
    return bytes(out)


@cache
def npz_seeds():
    from voxkernel.grid import write_npz

    mask, field = _sample_grids()
    found = []
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "a.npz"
        for grids in (mask, [mask, field]):
            write_npz(file, grids)
            members = fm.zip_members(file.read_bytes())
            found += [fm.zip_bytes(members), fm.zip_bytes(members, zipfile.ZIP_STORED)]
    return found


def damage_npz(rng, data):
    return fm.damage_zip(rng, data, damage_member)


def damage_member(rng, name, content):
    """The JSON text inside an array of one text, or any array."""
    if name in ("header.npy", "summary.npy") and rng.random() < 0.7:
        text = str(np.load(io.BytesIO(content)))
        try:
            text = fm.damage_json_text(rng, text.encode()).decode("utf-8", "replace")
            stream = io.BytesIO()
            np.save(stream, np.array(text))
            return stream.getvalue()
        except UnicodeEncodeError:
            return content
    return fm.damage_npy(rng, content)


@cache
def kernel_npz_seeds():
    """As `voxkernel kernel cube.ply -o cube.npz` writes it."""
    from voxkernel.voxels import voxel_kernel

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "a.npz"
        voxel_kernel(shapes.cube(), depth=3, domain="box").write(file)
        return [fm.zip_bytes(fm.zip_members(file.read_bytes()))]
