"""Damaged .npz files: one clear error of the library, no pickle, nothing unpacked that does not fit the file."""

import io
import pickle
import struct
import tracemalloc
import zipfile

import numpy as np
import pytest
import shapes

from voxkernel._npz import NpzArrays
from voxkernel.cli.main import main
from voxkernel.errors import GridReadError
from voxkernel.grid import SparseGrid, read_npz, write_npz
from voxkernel.voxels import KernelGrid, voxel_kernel

DEEP = "[" * 100_000


def kernel_grid():
    return voxel_kernel(shapes.cube(), depth=3, domain="box")


def saved(value):
    stream = io.BytesIO()
    np.save(stream, np.array(value))
    return stream.getvalue()


def made(header, body=b"", version=1):
    """An .npy file with any header."""
    length = struct.pack("<H" if version == 1 else "<I", len(header))
    return b"\x93NUMPY" + bytes([version, 0]) + length + header.encode() + body


def header_of(dtype, shape):
    return f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}\n"


def archive(path, text, compression=zipfile.ZIP_DEFLATED):
    """A file whose texts are all `text`, whichever reader asks for one."""
    with zipfile.ZipFile(path, "w", compression) as file:
        for name in ("format.npy", "header.npy"):
            file.writestr(name, text)
    return path


class Fatal:
    """Ends the test when it is unpickled."""

    def __reduce__(self):
        return pytest.fail, ("a pickle was loaded",)


DAMAGED = {
    "nested header": (made("(" * 9000 + ")" * 9000 + "\n"), "header of 18001 bytes"),
    "nested short header": (made("(" * 4000 + ")" * 4000 + "\n"), "numbers or text"),
    "open header": (made("{'descr': '<U1', 'fortran_order': False, 'shape': (1L,\n"), "numbers or text"),
    "long header": (made("[" * 60000, version=2), "header of 60000 bytes"),
    "negative shape": (made(header_of("<f8", "(-5,)")), "numbers or text"),
    "large shape": (made(header_of("<f8", "(10000000000,)")), "must have 80000000000 bytes for its shape; got 0"),
    "no width": (made(header_of("<U0", "(100000000000,)")), "bytes for its shape"),
    "many axes": (made(header_of("<f8", "(1, 1, 1, 1, 1, 1, 1, 1, 1)"), bytes(8)), "9 axes"),
    "pickle": (made(header_of("|O", "(1,)"), pickle.dumps([Fatal()])), "numbers or text"),
    "bare pickle": (pickle.dumps([Fatal()]), "not an array of NumPy"),
    "numbers": (saved([1.0, 2.0]), "must be one text"),
    "no such number": (made(header_of("<i6", "()"), bytes(6)), "numbers or text; got '<i6'"),
    "no characters": (made(header_of("<U2", "()"), (0x110000).to_bytes(4, "little") * 2), "no characters"),
    "half a pair": (made(header_of("<U2", "()"), (0xD800).to_bytes(4, "little") * 2), "no characters"),
    "nothing": (b"", "not an array of NumPy"),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_damaged_members_are_refused(tmp_path, capsys, case):
    text, match = DAMAGED[case]
    path = archive(tmp_path / "a.npz", text)
    with pytest.raises(GridReadError, match=match):
        read_npz(path)
    with pytest.raises(GridReadError, match=match):
        KernelGrid.read(path)
    assert main(["info", str(path)]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "a.npz" in said


@pytest.mark.parametrize("method", [zipfile.ZIP_LZMA, zipfile.ZIP_BZIP2])
def test_other_compressions_are_refused(tmp_path, method):
    path = archive(tmp_path / "a.npz", saved("text"), method)
    with pytest.raises(GridReadError, match="other means than deflate"):
        read_npz(path)


def test_damaged_bytes_are_refused(tmp_path, capsys):
    """Every 19th byte of a small file turned over, one at a time: an answer or one line."""
    path = tmp_path / "a.npz"
    kernel_grid().write(path)
    good = path.read_bytes()
    assert KernelGrid.read(path).depth == 3
    for at in range(0, len(good), 19):
        path.write_bytes(good[:at] + bytes([good[at] ^ 0x5A]) + good[at + 1 :])
        code = main(["info", str(path)])
        said = capsys.readouterr().err
        assert code in (0, 1)
        assert said.count("\n") == code


@pytest.mark.parametrize(
    "metadata", [DEEP, "5", '{"a": ' + "[" * 500 + "]" * 500 + "}", '{"a": ' + "9" * 5000 + "}", "{"]
)
def test_damaged_metadata_is_refused(tmp_path, capsys, metadata):
    path = tmp_path / "a.npz"
    header = f'{{"format": "voxkernel-grid", "version": 1, "grids": [], "metadata": {metadata}}}'
    np.savez(path, header=np.array(header))
    for more in ([], ["--json"]):
        assert main(["info", str(path), *more]) == 1
        assert "must be an .npz file of this library" in capsys.readouterr().err


@pytest.mark.parametrize("header", [DEEP, "5", '{"format": "voxkernel-grid", "version": 1, "grids": [7]}'])
def test_damaged_headers_of_grids_are_refused(tmp_path, header):
    path = tmp_path / "a.npz"
    np.savez(path, header=np.array(header))
    with pytest.raises(GridReadError, match=r"a\.npz: `path` must be an \.npz file of this library"):
        read_npz(path)


def test_a_bomb_is_not_unpacked(tmp_path):
    """A text of 100 MB in 100 kB; and one file that lends its bytes to a hundred members."""
    n = 25_000_000
    path = archive(tmp_path / "a.npz", made(header_of(f"<U{n}", "()"), bytes(4 * n)))
    assert path.stat().st_size < 300_000
    tracemalloc.start()
    try:
        with pytest.raises(GridReadError, match="more than 67108864"):
            read_npz(path)
        assert tracemalloc.get_traced_memory()[1] < 5_000_000
    finally:
        tracemalloc.stop()
    write_npz(path, SparseGrid.from_ijk([[0, 0, 0]]))
    data = path.read_bytes()
    entry = data.find(b"PK\x01\x02")
    lying = bytearray(data)
    lying[entry + 24 : entry + 28] = struct.pack("<I", 2**31)  # the size of the first member
    with pytest.raises(ValueError, match="promises 2147483648 bytes"):
        NpzArrays(bytes(lying))
    twice = data[:entry] + data[entry:].replace(b"0.leaf_mask.npy", b"0.tile_log2.npy")
    with pytest.raises(ValueError, match="twice"):
        NpzArrays(twice)


def test_arrays_are_as_numpy_reads_them(tmp_path, rng):
    arrays = {
        "a": rng.random((3, 4)), "b": np.asfortranarray(rng.integers(0, 9, (2, 3))), "c": np.array("text"),
        "d": np.zeros((0, 3), np.int32), "e": np.array([True, False]), "f": np.float64(2.5),
    }  # fmt: skip
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "a.npz", **arrays)
        with NpzArrays(tmp_path / "a.npz") as found:
            for name, array in arrays.items():
                assert name in found
                assert found[name].dtype == array.dtype
                np.testing.assert_array_equal(found[name], array)
            assert found.text("c") == "text"
            with pytest.raises(ValueError, match="no array 'z'"):
                found["z"]
