"""Damaged surface files are refused with the line or byte that is wrong; files that follow their format are read."""

import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.errors import MeshError, MeshReadError
from voxkernel.mesh.files import read_polygons
from voxkernel.mesh.text_rows import parse_rows

HEAD = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
FACE = "element face 1\nproperty list uchar int vertex_indices\n"
BODY = "0 0 0\n1 0 0\n0 1 0\n"
PLY = HEAD + FACE + "end_header\n" + BODY + "3 0 1 2\n"
OFF = "OFF\n3 1 0\n" + BODY + "3 0 1 2\n"
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf {}\n"
LOOP = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
STL = "solid a\n" + LOOP + "endsolid a\n"


@pytest.mark.parametrize(
    ("name", "content", "match"),
    [
        ("a.ply", PLY.replace("element vertex 3", "element vertex -3"), "line 3: the number of elements .*got '-3'"),
        ("a.ply", PLY.replace("element vertex 3", "element vertex 3 3"), "line 3: unknown word"),
        ("a.ply", PLY.replace("element vertex 3", "element vertex 3_0"), "line 3: the number of elements"),
        ("a.ply", HEAD + HEAD[21:] + FACE + "end_header\n" + BODY * 2 + "3 0 1 2\n", "line 7: element vertex is"),
        ("a.ply", PLY.replace("element face", "elemint face"), "line 7: unknown word 'elemint face 1'"),
        ("a.ply", PLY.replace("property float z", "property float x"), "line 6: element vertex has property x twice"),
        ("a.ply", PLY.replace("property float z", "property flaot z"), "line 6: unknown word 'flaot' for a type"),
        ("a.ply", PLY.replace("element vertex 3\n", ""), "line 3: a property stands before"),
        ("a.ply", PLY.replace("list uchar", "list float"), "line 8: the size of a list must be of a whole type"),
        ("a.ply", PLY.replace("ascii 1.0", "ascii 1.1"), "line 2: format must be"),
        ("a.ply", PLY.replace("ascii 1.0", "ascii 1.0\nformat ascii 1.0"), "line 3: unknown word 'format"),
        ("a.ply", PLY.replace("end_header", "comment end_header"), "unknown word '0 0 0'"),
        ("a.ply", PLY + "3 0 1 2\n", "line 14: it follows the last element"),
        ("a.ply", PLY.replace("3 0 1 2", "3 0 1 2 2"), "line 13: a line of element face is too long"),
        ("a.ply", PLY.replace("3 0 1 2", "-3 0 1 2"), "line 13: a list of element face has no size"),
        ("a.ply", PLY.replace("3 0 1 2", "3e15 0 1 2"), "line 13: a line of element face is too short"),
        ("a.ply", PLY.replace("1 0 0\n", "1 0 0 0\n"), "line 11: a line of element vertex is too long"),
        ("a.ply", PLY.replace("1 0 0\n", "1 0 0_0\n"), "line 11: could not convert '0_0'"),
        ("a.ply", PLY.replace("1 0 0\n", "1 0\0 0\n"), "line 11: it holds the byte 0"),
        ("a.ply", PLY.replace("face 1\n", "face 1\nproperty int a\n").replace("3 0 1 2", ".5 3 0 1 2"), "not a whole"),
        ("a.off", OFF + "3 0 1 2\n", "line 7: it follows the last face"),
        ("a.off", OFF.replace("3 1 0", "3 1"), "line 2: it must hold the numbers"),
        ("a.off", OFF.replace("3 1 0", "3 1 0 x"), "line 2: it must hold the numbers"),
        ("a.off", OFF.replace("3 1 0", "3 -1 0"), "line 2: it must hold the numbers"),
        ("a.off", OFF.replace("3 1 0", "9999999999999 1 0"), "ends before its 9999999999999 vertices"),
        ("a.off", OFF.replace("1 0 0", "1 0 0 7"), "line 4: a vertex of OFF has the wrong number of numbers"),
        ("a.off", OFF.replace("3 0 1 2", "3 0 1 2 0"), None),
        ("a.off", OFF.replace("3 0 1 2", "3 0 1 2 0 0"), "line 6: a face has more indices than it says"),
        ("a.off", OFF.replace("3 0 1 2", "4 0 1 2"), "line 6: a face has fewer indices"),
        ("a.off", OFF.replace("3 0 1 2", "2.5 0 1 2"), "line 6: a face does not start"),
        ("a.off", OFF.replace("1 0 0", "1 0 x"), "line 4: could not convert 'x'"),
        ("a.obj", OBJ.format("1/1 /2 3/3"), "line 4: a face has a corner that is not"),
        ("a.obj", OBJ.format("1// 2// 3//"), "line 4: a face has a corner"),
        ("a.obj", OBJ.format("1/a 2/2 3/3"), "line 4: a face has a corner"),
        ("a.obj", OBJ.format("1/1/1/1 2 3"), "line 4: a face has a corner"),
        ("a.obj", OBJ.format("1 2/2 3"), "line 4: a face has a corner"),
        ("a.obj", OBJ.format("1.0 2 3"), "line 4: a face has a corner"),
        ("a.obj", OBJ.format("1 2 3-"), "line 4: a face has a corner"),
        ("a.obj", OBJ.format("1 2 4"), "line 4: a vertex index is beyond the 3 vertices"),
        ("a.obj", OBJ.format("1 2 0"), "line 4: vertex index 0"),
        ("a.obj", OBJ.format("1 2 -4"), "line 4: a relative vertex index reaches before"),
        ("a.obj", OBJ.format("1 2 3").replace("v 1 0 0", "v 1 0 0 1 1"), "line 2: a vertex has neither"),
        ("a.obj", OBJ.format("1 2 3").replace("v 1 0 0", "v 1 0"), "line 2: a vertex has fewer"),
        ("a.obj", OBJ.format("1 2 3").replace("v 1 0 0", "w 1 0 0"), "line 2: unknown word 'w'"),
        ("a.obj", OBJ.format("1 2 3 \\"), "line 4: it goes on, but the file ends"),
        ("a.obj", OBJ.format("1 2 3") + "call other.obj\n", "line 5: unknown word 'call'"),
        ("a.stl", STL.replace("vertex 1 0 0", "vertex 1 0 x"), "line 5: could not convert 'x'"),
        ("a.stl", STL.replace("vertex 1 0 0\n", ""), "line 2: here must be a facet of three corners"),
        ("a.stl", STL.replace("endsolid a\n", ""), "here must be a facet of three corners or endsolid"),
        ("a.stl", STL + LOOP, "line 10: here must be solid or the end"),
        ("a.stl", STL.replace("outer loop", "outer"), "line 2: here must be a facet"),
        ("a.stl", STL.replace(LOOP, LOOP.replace("vertex 0 1 0\n", "") + LOOP.replace("endl", "vertex 1 1 1\nendl")),
         "line 2: here must be a facet"),
    ],
)  # fmt: skip
def test_damaged_text_is_refused_with_its_line(tmp_path, name, content, match):
    path = tmp_path / name
    path.write_bytes(content.encode())
    if match is None:
        assert len(read_polygons(path).sizes) == 1
        return
    with pytest.raises(MeshReadError, match=match) as caught:
        read_polygons(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.ply", PLY.replace("\n", "\r\n")),
        ("a.ply", PLY.replace("\n", "\r")),
        ("a.ply", PLY.replace("element vertex", "comment end_header\nobj_info element vertex 9\nelement vertex")),
        ("a.ply", HEAD + FACE + "element edge 1\nproperty int a\nend_header\n" + BODY + "3 0 1 2\n0\n\n"),
        ("a.off", "# before\n\n" + OFF.replace("\n", " # behind\r\n")),
        ("a.off", "CNOFF\n3 1 0\n" + BODY.replace("\n", " 0 0 1 .5 .5 .5 1\n") + "3 0 1 2 7\n"),
        ("a.obj", OBJ.format("1/4/7 2/5/-1 -1/6/9") + "g a b\ns 1\nusemtl c\nl 1 2\np 1\nvp 1\n"),
        ("a.obj", OBJ.format("1 \\\n2 \\\n3")),
        ("a.obj", OBJ.format("+1 2 3").replace("\n", "\r")),
        ("a.stl", STL.replace("\n", "\r\n   ").replace("solid a", "solid")),
        ("a.stl", "solid empty\nendsolid empty\n" + STL.upper()),
    ],
)  # fmt: skip
def test_files_that_follow_their_format_are_read(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content.encode())
    found = read_polygons(path)
    assert found.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert found.flat.tolist() == [0, 1, 2]
    assert found.sizes.tolist() == [3]


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("count", ["B", "b"])
def test_damaged_binary_ply(tmp_path, order, count):
    word, kind = {"<": "little", ">": "big"}[order], {"B": "uchar", "b": "char"}[count]
    head = PLY[: PLY.index("end_header")].replace("ascii", f"binary_{word}_endian").replace("uchar", kind)
    head = head.replace("face 1", "face 2") + "end_header\n"
    corners = struct.pack(order + "9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    rows = [struct.pack(f"{order}{count}{n}i", n, *range(n)) for n in (3, 2)]
    path = tmp_path / "a.ply"
    data = head.encode() + corners + b"".join(rows)
    path.write_bytes(data)
    assert read_polygons(path).sizes.tolist() == [3, 2]
    for wrong, match in [
        (data + b"\n", f"byte {len(data)}: 1 bytes follow the last element"),
        (data[:-1], f"byte {len(data) - 1}: the file ends before its 2 face"),
        (data.replace(b"face 2", b"face 250000000"), "the file ends before its 250000000 face"),
        (data.replace(b"vertex 3", b"vertex 250000000000000"), "ends before its 250000000000000 vertex"),
        (data.replace(b"vertex 3", b"vertex -1"), "line 3: the number of elements"),
        (data[:-9] + b"\xff" + data[-8:], "negative size" if count == "b" else "ends before"),
    ]:
        path.write_bytes(wrong)
        with pytest.raises(MeshReadError, match=match):
            read_polygons(path)


def test_signalling_nan_in_binary_stl(tmp_path):
    corners = np.zeros(12, "<u4")
    corners[5] = 0x7F800001
    path = tmp_path / "a.stl"
    path.write_bytes(bytes(80) + struct.pack("<I", 1) + corners.tobytes() + bytes(2))
    with pytest.raises(MeshError, match=r"a\.stl': `vertices` must be finite; got nan in row 0"):
        voxkernel.as_mesh(path)


def test_counts_beyond_the_file_take_no_memory(tmp_path):
    """Each reader in a child with 1 GB: the count is compared with the bytes that are left before any array is made."""
    resource = pytest.importorskip("resource")
    assert resource
    binary = PLY[: PLY.index("0 0 0")].replace("ascii", "binary_little_endian").replace("face 1", "face 250000000")
    files = {
        "a.ply": binary.replace("list uchar int", "list uint int").encode() + struct.pack("<9fI", *range(9), 2**32 - 1),
        "b.ply": PLY.replace("face 1", "face 250000000").encode(),
        "c.ply": binary.encode() + struct.pack("<9fBi", *range(9), 1, 0) * 3,
        "a.off": OFF.replace("3 1 0", "250000000 250000000 0").encode(),
        "a.stl": bytes(80) + struct.pack("<I", 250_000_000) + bytes(100),
        "a.obj": OBJ.format("1 2 250000000").encode(),
    }
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    code = (
        "import resource, sys\nfrom voxkernel.mesh.files import read_polygons\n"
        "resource.setrlimit(resource.RLIMIT_DATA, (1 << 30, 1 << 30))\n"
        "for path in sys.argv[1:]:\n    try:\n        read_polygons(path)\n"
        "    except OSError as error:\n        print(error)\n"
    )
    env = {**os.environ, "PYTHONPATH": str(Path(voxkernel.__file__).parent.parent), "OPENBLAS_NUM_THREADS": "1"}
    run = [sys.executable, "-c", code, *(str(tmp_path / name) for name in files)]
    done = subprocess.run(run, capture_output=True, text=True, timeout=120, env=env)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == len(files)
    assert not any("llocate" in line for line in lines), lines


@pytest.mark.parametrize("suffix", [".ply", ".off", ".obj", ".stl"])
def test_what_we_write_we_read(tmp_path, suffix):
    mesh = voxkernel.as_mesh(shapes.icosphere(1))
    mesh.write(tmp_path / f"a{suffix}")
    again = voxkernel.as_mesh(tmp_path / f"a{suffix}")
    np.testing.assert_allclose(again.vertices[again.faces], mesh.vertices[mesh.faces], atol=1e-7)


def test_rows_without_numbers_are_rows():
    """No warning of NumPy, which asks for data: the reader says what is wrong."""
    values, width = parse_rows(["", " "])
    assert len(values) == 0
    assert width.tolist() == [0, 0]
