"""Files read in stretches by the core: the same to the last bit as the parser of the format, or left to it."""

import random
import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from voxkernel.mesh import usual_files
from voxkernel.mesh.files import Polygons, merge_equal_corners, read_polygons, write_triangles
from voxkernel.mesh.obj import parse_obj
from voxkernel.mesh.off import parse_off
from voxkernel.mesh.ply import parse_ply
from voxkernel.mesh.stl import parse_stl
from voxkernel.mesh.usual_files import read_usual

sys.path.append(str(Path(__file__).resolve().parent.parent / "faults"))
from fuzz import make_input
from fuzz_formats import FORMATS

PARSERS = {".ply": parse_ply, ".off": parse_off, ".obj": parse_obj, ".stl": parse_stl}
CORNERS = "0 0 0\n1 0 0\n0 1 0\n"
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf {}\n"
OFF = "OFF\n3 1 0\n" + CORNERS + "3 0 1 2{}\n"
PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
PLY += "element face 1\nproperty list uchar int vertex_indices\nend_header\n" + CORNERS + "3 0 1 2\n"
STL = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
STL += "endsolid a\n"


def parsed(path):
    """What the parser of the format makes of a file; None where it refuses it."""
    data = path.read_bytes()
    try:
        found = PARSERS[path.suffix](data) if data.strip() else None
    except (ValueError, OverflowError):
        return None
    return merge_equal_corners(found) if found is not None and path.suffix == ".stl" else found


def bits(polygons):
    return [np.asarray(polygons.vertices, np.float64).tobytes(), *(array.tolist() for array in polygons[1:])]


@pytest.mark.parametrize("name", ["ply_ascii", "ply_little", "ply_big", "off", "obj", "stl_ascii"])
def test_damaged_files_are_read_as_by_the_parser_or_left_to_it(tmp_path, monkeypatch, name):
    path = tmp_path / f"a{FORMATS[name].suffix}"
    rng = random.Random(name)
    n_same = n_left = 0
    for number in range(120):
        path.write_bytes(make_input(name, 5, number)[0])
        monkeypatch.setattr(usual_files, "_STRETCH", rng.choice([1, 7, 100, 1 << 22]))
        found = read_usual(path)
        if found is None:
            n_left += 1
            continue
        expected = parsed(path)
        if expected is None:
            assert len(found.sizes) == 0  # which its caller leaves to the parser as well
            continue
        assert bits(found) == bits(expected), number
        n_same += 1
    assert n_same > 8
    assert n_left > 8


@pytest.mark.parametrize("stretch", [1, 7, 1000])
@pytest.mark.parametrize("suffix", [".ply", ".off", ".obj"])
def test_the_length_of_a_stretch_changes_nothing(tmp_path, monkeypatch, rng, suffix, stretch):
    vertices, faces = rng.normal(size=(40, 3)) * 10.0 ** rng.integers(-200, 200, (40, 1)), rng.integers(0, 40, (30, 3))
    path = tmp_path / f"a{suffix}"
    write_triangles(path, vertices, faces)
    monkeypatch.setattr(usual_files, "_STRETCH", stretch)
    found = read_usual(path)
    assert found is not None
    assert bits(found) == [vertices.tobytes(), faces.reshape(-1).tolist(), [3] * 30]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.obj", OBJ.format("1/4/7 2/5/-1 -1/6/9") + "g a b\ns 1\nusemtl c\nl 1 2\n"),
        ("a.obj", "# made by hand\n" + OBJ.format("1//4 2//5 3//6 # c")),
        ("a.obj", OBJ.format("-3 -2\t-1").replace("\n", "\r\n")),
        ("a.obj", "f 1 2 3\n" + OBJ.format("1 2 3").replace("f 1 2 3\n", "")),
        ("a.obj", OBJ.format("+1 2 3").replace("\n", "\r").replace("1 0 0", "1 0 0 .5 .5 .5")),
        ("a.off", OFF.format("")), ("a.off", OFF.format(" 1 0 0 # red").replace("\n", "\r\n")),
        ("a.ply", PLY), ("a.ply", PLY.replace("\n", "\r\n")),
        ("a.ply", PLY.replace("element face", "comment x\nelement face")),
        ("a.stl", STL), ("a.stl", STL.upper()),
        ("a.stl", STL.replace("\n", "\r\n  ").replace("endsolid a", "end solid")),
    ],
)  # fmt: skip
def test_usual_files(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content.encode())
    found = read_usual(path)
    assert found is not None
    assert found.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert (found.flat.tolist(), found.sizes.tolist()) == ([0, 1, 2], [3])
    assert bits(found) == bits(parsed(path))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.obj", OBJ.format("1 \\\n2 3")), ("a.obj", OBJ.format("1 2 4")), ("a.obj", OBJ.format("0 1 2")),
        ("a.obj", OBJ.format("-4 1 2")), ("a.obj", OBJ.format("1/1 2 3")), ("a.obj", OBJ.format("1/1/ 2/1/ 3/1/")),
        ("a.obj", OBJ.format("1 2 3").replace("v 1 0 0", "v 1 0")), ("a.obj", OBJ.format("1 2 3") + "wrong\n"),
        ("a.obj", OBJ.format("1 2 3").replace("v 1 0 0", "v nan 0 0")), ("a.obj", OBJ.format("1 2 9007199254740993")),
        ("a.obj", OBJ.format("1 2 3").replace("v 1 0 0", "v 1e999 0 0")), ("a.obj", OBJ.format("1 2 3") + "# \x01\n"),
        ("a.obj", OBJ.format("1 2 3").replace("v 1 0 0", "v 1_0 0 0")),
        ("a.off", OFF.format(" 1 2")), ("a.off", OFF.format("") + "1"),
        ("a.off", OFF.format("").replace("3 1 0", "3 2 0")),
        ("a.off", "OFF BINARY\n"), ("a.off", OFF.format("").replace("1 0 0", "1 0")),
        ("a.ply", PLY + "1\n"), ("a.ply", PLY.replace("3 0 1 2", "4 0 1 2")), ("a.ply", PLY.replace("1 2", "1 2.5")),
        ("a.ply", PLY.replace("float x", "int x").replace("1 0 0", ".5 0 0")),
        ("a.ply", PLY.replace("float x", "float a")),
        ("a.stl", STL.replace("loop", "lop")), ("a.stl", STL[:-12]), ("a.stl", STL.replace("1 0 0", "1 0 x")),
        ("a.stl", STL.replace("endsolid", "end  solid")), ("a.stl", "x" + STL),
    ],
)  # fmt: skip
def test_what_is_unusual_is_left_to_the_parser(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content.encode())
    assert read_usual(path) is None


def test_numbers_are_those_of_python(tmp_path, rng):
    """Halfway cases, the smallest and the largest doubles, more digits than a double has."""
    words = ["5e-324", "2.4703282292062328e-324", "1.7976931348623157e308", "9007199254740993", "-0"]
    words += ["+1.", ".5", "1E+2"]
    words += ["0." + "0" * 400 + "1e400", "1" + "0" * 300, "179769313486231580793" + "0" * 285]
    words += [f"{float(x)!r}{''.join(rng.choice(list('0123456789'), 25))}" for x in rng.normal(size=30)]
    mantissas, exponents = rng.integers(1, 1 << 62, 200).tolist(), rng.integers(-320, 280, 200).tolist()
    words += [f"{m}e{e}" for m, e in zip(mantissas, exponents, strict=True)]
    even = rng.integers(1 << 52, 1 << 53, 50)
    words += [str(2 * int(m) + 1) for m in even] + [f"{int(m)}.5" for m in even // 8]
    words += ["0"] * (-len(words) % 3)
    path = tmp_path / "a.obj"
    rows = ["v " + " ".join(words[k : k + 3]) for k in range(0, len(words), 3)]
    path.write_text("\n".join(rows) + "\nf 1 2 3\n")
    found = read_usual(path)
    assert found is not None
    assert [x.hex() for x in found.vertices.reshape(-1).tolist()] == [float(word).hex() for word in words]


@pytest.mark.parametrize("order", "<>")
def test_all_types_of_a_binary_ply(tmp_path, order):
    names = "char uchar short ushort int uint int64 uint64 float double".split()
    types = dict(zip(names, "bBhHiIqQfd", strict=True))
    word = {"<": "little", ">": "big"}[order]
    for name, code in types.items():
        for count, count_code in types.items():
            if count in ("float", "double"):
                continue
            head = f"ply\nformat binary_{word}_endian 1.0\nelement vertex 3\n"
            head += "".join(f"property {name} {axis}\n" for axis in ("x", "nx", "y", "z"))
            head += f"element other 2\nproperty list {count} {name} a\nproperty short b\n"
            head += f"element face 2\nproperty uchar c\nproperty list {count} {name} vertex_index\nend_header\n"
            body = struct.pack(f"{order}12{code}", *range(12))
            body += struct.pack(f"{order}{count_code}2{code}h", 2, 7, 7, 7) + struct.pack(f"{order}{count_code}h", 0, 7)
            body += struct.pack(f"{order}B{count_code}3{code}", 9, 3, 0, 1, 2)
            body += struct.pack(f"{order}B{count_code}4{code}", 9, 4, 0, 1, 2, 0)
            path = tmp_path / "a.ply"
            path.write_bytes(head.encode() + body)
            found = read_usual(path)
            assert found is not None
            assert found.vertices.tolist() == [[0, 2, 3], [4, 6, 7], [8, 10, 11]]
            assert (found.flat.tolist(), found.sizes.tolist()) == ([0, 1, 2, 0, 1, 2, 0], [3, 4])
            assert bits(found) == bits(parse_ply(path.read_bytes()))
            path.write_bytes(head.encode() + body[:-1])
            assert read_usual(path) is None


def test_index_beyond_what_a_double_can_hold_is_left_to_the_parser(tmp_path):
    head = PLY[: PLY.index("0 0 0")].replace("ascii", "binary_little_endian").replace("uchar int", "uchar int64")
    path = tmp_path / "a.ply"
    for index, is_read in [(2, True), (-5, True), (2**53, False), (-(2**53), False)]:
        path.write_bytes(head.encode() + struct.pack("<9fB3q", *range(9), 3, 0, 1, index))
        assert (read_usual(path) is not None) == is_read


def test_equal_corners_become_one_vertex_in_the_order_of_appearance(rng):
    points = rng.integers(-2, 3, (5000, 3)) * np.array([1.0, 1e-300, 0.1])
    points[rng.random(points.shape) < 0.05] *= -1.0  # makes negative zeros
    points[100:103] = np.nan
    ids = np.arange(len(points)).reshape(-1)
    merged = merge_equal_corners(Polygons(points, ids, np.full(0, 3)))
    numbers, expected, kept = {}, [], []
    for row in points.tolist():
        key = tuple(row) if row == row and all(x == x for x in row) else object()
        if key not in numbers:
            numbers[key] = len(kept)
            kept.append(row)
        expected.append(numbers[key])
    assert merged.flat.tolist() == expected
    assert merged.vertices.tobytes() == np.array(kept).tobytes()


def test_a_text_stl_has_its_equal_corners_merged(tmp_path):
    path = tmp_path / "a.stl"
    path.write_text("".join(STL.replace("vertex 1 0 0", f"vertex {x} 0 -0") for x in (1, 1, 2)))
    found = read_polygons(path)
    assert found.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]]
    assert found.flat.tolist() == [0, 1, 2, 0, 1, 2, 0, 3, 2]
