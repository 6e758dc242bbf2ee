"""Files of unstructured grids: as VTK writes them in every way it can, and damaged in every way we could think of."""

import re
from itertools import product

import numpy as np
import pytest

from voxkernel.errors import MeshReadError
from voxkernel.polyhedral.files import read_cells

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1 / 3], [1, 1, 1], [2, 0, 0], [2, 2, 2], [0, 3, 0]])
TETRA = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
MIXED = [TETRA, [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]], TETRA, TETRA]


def grid():
    """A polyhedron, a triangle, a hexahedron, a tetrahedron and the polyhedron again."""
    import pyvista

    body = [4, *(word for face in TETRA for word in (3, *face))]
    cells = [len(body), *body, 3, 0, 1, 2, 8, *range(8), 4, 0, 1, 2, 3, len(body), *body]
    return pyvista.UnstructuredGrid(np.array(cells), np.array([42, 5, 12, 10, 42], np.uint8), POINTS)


def written(path, mode, compressor, order="LittleEndian", header=32, base64=False, old=False):
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    writer = vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(grid())
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    getattr(writer, f"SetByteOrderTo{order}")()
    getattr(writer, f"SetHeaderTypeToUInt{header}")()
    writer.SetEncodeAppendedData(base64)
    writer.SetBlockSize(48)  # several blocks an array
    assert writer.Write() == 1
    return path


def faces_of(raw):
    ends = np.cumsum(raw.sizes)
    faces = [raw.flat[end - size : end].tolist() for end, size in zip(ends, raw.sizes, strict=True)]
    last = np.cumsum(raw.counts)
    return [faces[end - n : end] for end, n in zip(last, raw.counts, strict=True)]


FORMS = [("Ascii", "None", False), *product(("Binary",), ("None", "ZLib", "LZ4", "LZMA"), (False,))]
FORMS += list(product(("Appended",), ("None", "ZLib", "LZ4", "LZMA"), (False, True)))


@pytest.mark.parametrize(("mode", "compressor", "base64"), FORMS)
@pytest.mark.parametrize(("order", "header"), [("LittleEndian", 32), ("BigEndian", 64)])
def test_every_form_vtk_writes(tmp_path, mode, compressor, base64, order, header):
    path = written(tmp_path / "a.vtu", mode, compressor, order, header, base64)
    raw = read_cells(path)
    np.testing.assert_array_equal(raw.vertices, POINTS)
    assert faces_of(raw) == MIXED


ARRAY = '<DataArray type="{}" Name="{}" format="ascii">{}</DataArray>\n'
FACES = "4 3 0 2 1 3 0 1 3 3 1 2 3 3 0 3 2"


def text(n_points="4", n_cells="2", pieces=1, **arrays):
    """A polyhedron and a tetrahedron, with the older arrays of faces."""
    given = {
        "connectivity": "0 1 2 3 0 1 2 3", "offsets": "4 8", "types": "42 10", "faces": FACES, "faceoffsets": "17 -1",
    } | arrays  # fmt: skip
    points = given.pop("points", "0 0 0 1 0 0 0 1 0 0 0 1")
    cells = "".join(ARRAY.format("Int64", name, value) for name, value in given.items() if value is not None)
    piece = f'<Piece NumberOfPoints="{n_points}" NumberOfCells="{n_cells}"><Points><DataArray type="Float64"'
    piece += f' NumberOfComponents="3" format="ascii">{points}</DataArray></Points><Cells>{cells}</Cells></Piece>'
    head = '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">'
    return f"{head}<UnstructuredGrid>{piece * pieces}</UnstructuredGrid></VTKFile>"


def test_older_arrays_of_faces_and_pieces(tmp_path):
    path = tmp_path / "a.vtu"
    path.write_text(text(pieces=2))
    raw = read_cells(path)
    turned = [[[v + 4 for v in face] for face in TETRA]] * 2
    assert len(raw.vertices) == 8
    assert faces_of(raw) == [TETRA] * 2 + turned


BLOCKS = '<DataArray type="Int64" Name="offsets" format="binary">{}</DataArray>'


@pytest.mark.parametrize(
    ("content", "match"),
    [
        ("no xml", "it is no XML"),
        ("<VTKFile type='PolyData'/>", "no VTKFile of type UnstructuredGrid"),
        ('<VTKFile type="UnstructuredGrid"/>', "no Piece"),
        (text(n_cells="-1"), "NumberOfCells must be a number from 0; got '-1'"),
        (text(n_cells="500000000"), "array 'types' has 2 values for 500000000 cells"),
        (text(n_cells="1000000000000000"), "array 'types' has 2 values"),
        (text(n_cells="9" * 30), "NumberOfCells must be a number"),
        (text(n_points="1000000000000000"), "12 coordinates are not those of 1000000000000000 points"),
        (text(points="0 0 0 1 0"), "5 coordinates"),
        (text(points="0 0 0 1 inf 0 0 1 0 0 0 1"), "point 1 of 4 is not finite: a coordinate is inf"),
        (text(points="0 0 0 1 0 0 0 1 0 0 0 1_0"), "no number"),
        (text(offsets="4 900000000"), r"array 'offsets' must rise from 0 to 8; got \[0, 4, 900000000\]"),
        (text(offsets="-4 8"), "array 'offsets' must rise"),
        (text(offsets="9 8"), "array 'offsets' must rise"),
        (text(offsets="4"), "array 'offsets' has 1 values, not 2"),
        (text(offsets="4 8.5"), "array 'offsets': it holds something that is no whole number"),
        (text(offsets="4 99999999999999999999"), "no whole number of type int64"),
        (text(offsets=None), "no array 'offsets'"),
        (text(connectivity="0 1 2 3 0 1 2 4"), "array 'connectivity' names point 4 of 4"),
        (text(connectivity="0 1 2 3 0 1 2 -1"), "names point -1"),
        (text(types="42 12"), "cell 1 of type 12 does not have 8 points"),
        (text(types="42 25"), "cell 1 is of VTK type 25"),
        (text(types="42 77"), "cell 1 is of VTK type 77"),
        (text(types="1 3"), "no cells with a volume"),
        (text(faces=None), "no array 'faces'"),
        (text(faceoffsets="17"), "array 'faceoffsets' has 1 values"),
        (text(faceoffsets="18 -1"), "array 'faceoffsets' goes from 0 to 18"),
        (text(faceoffsets="-1 -1"), "array 'faceoffsets' goes from 0 to -1"),
        (text(faces=FACES.replace("4 3", "999999999 3", 1)), "array 'faces' ends inside cell 0"),
        (text(faces=FACES.replace("4 3", "3 3", 1)), "4 values too many in cell 0"),
        (text(faces=FACES.replace("4 3", "4 999999999", 1)), "array 'faces' ends inside cell 0"),
        (text(faces=FACES + " 7"), "1 values after the last cell"),
        (text(faces=FACES.replace("0 2 1", "0 2 9")), "array 'faces' names point 9 of 4"),
        (text().replace('type="Int64" Name="offsets"', 'type="Float64" Name="offsets"'), "does not hold indices"),
        (text().replace('type="Int64" Name="offsets"', 'type="Int65" Name="offsets"'), "is of type 'Int65'"),
        (text().replace('Name="offsets" format="ascii"', 'Name="offsets" format="x"'), "format is 'x'"),
        (text().replace('Name="offsets" format="ascii"', 'Name="offsets" format="appended" offset="9"'), "beyond"),
        (text().replace("</Cells>", ARRAY.format("Int64", "types", "1 1") + "</Cells>"), "two arrays 'types'"),
        (text().replace("LittleEndian", "MiddleEndian"), "byte_order is 'MiddleEndian'"),
        (text().replace("<UnstructuredGrid>", "<a>" * 30), "deeper than 16"),
        (text().replace("?>", "?><!DOCTYPE a [<!ENTITY b 'c'>]>", 1), "document type is not allowed"),
        (text().replace("</VTKFile>", ""), "it is no XML"),
    ],
)  # fmt: skip
def test_damaged_text(tmp_path, content, match):
    path = tmp_path / "a.vtu"
    path.write_text(content)
    with pytest.raises(MeshReadError, match=match) as caught:
        read_cells(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("mode", "compressor", "base64"), FORMS[1:])
def test_damaged_bytes(tmp_path, rng, mode, compressor, base64):
    """Sizes, tables and blocks overwritten: a mesh or one line, never the end of the process."""
    path = written(tmp_path / "a.vtu", mode, compressor, "LittleEndian", 32, base64)
    data = path.read_bytes()
    from_here = data.find(b"<AppendedData") if mode == "Appended" else 0
    refused = 0
    for _ in range(60):
        damaged = bytearray(data)
        at = int(rng.integers(from_here, len(data)))
        damaged[at : at + 4] = [b"\xff\xff\xff\xff", b"////", b"\0\0\0\0", b"AAAA", b"<"][rng.integers(5)]
        path.write_bytes(damaged)
        try:
            read_cells(path)
        except MeshReadError as error:
            refused += "\n" not in str(error)
    assert refused > 10


@pytest.mark.parametrize("compressor", ["None", "ZLib", "LZ4", "LZMA"])
def test_sizes_that_the_file_cannot_hold(tmp_path, compressor):
    path = written(tmp_path / "a.vtu", "Appended", compressor)
    data = path.read_bytes()
    at = data.find(b"_", data.find(b"<AppendedData")) + 1
    for word in range(1 if compressor == "None" else 3):
        for value in (b"\xff\xff\xff\xff", b"\x00\x00\x00\x40"):
            damaged = bytearray(data)
            damaged[at + 4 * word : at + 4 * word + 4] = value
            path.write_bytes(damaged)
            with pytest.raises(MeshReadError, match=r"array '\w+': (it claims|a block of) \d+ bytes|coordinates"):
                read_cells(path)


def test_arrays_that_lie_over_each_other(tmp_path):
    """Many pieces that name one block would make a small file large."""
    path = written(tmp_path / "a.vtu", "Appended", "ZLib")
    data = path.read_bytes()
    piece = re.search(rb"<Piece.*</Piece>", data, re.DOTALL)[0]
    path.write_bytes(data.replace(piece, piece * 50))
    with pytest.raises(MeshReadError, match="lies over other arrays"):
        read_cells(path)
