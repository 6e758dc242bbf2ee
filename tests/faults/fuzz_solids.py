"""Files of polyhedral meshes for the fuzzing."""

import base64
import re
import shutil
import struct
import zlib
from functools import cache

import fuzz_mutations as fm
import numpy as np
import shapes
from fuzz_surfaces import THIRDS, bodies, off_text, row_text


def read_cells(path):
    from voxkernel import cell_kernels, read_polyhedral

    mesh = read_polyhedral(path)
    assert np.isfinite(mesh.vertices).all(), "a coordinate is not finite"
    for offsets, ids, n in (
        (mesh.face_offsets, mesh.face_vertices, len(mesh.vertices)),
        (mesh.cell_offsets, mesh.cell_faces, len(mesh.face_offsets) - 1),
    ):
        assert offsets[0] == 0, "offsets do not start at 0"
        assert offsets[-1] == len(ids), "offsets do not end at the end"
        assert (np.diff(offsets) >= 0).all(), "offsets go down"
        assert not len(ids) or (ids.min() >= 0 and ids.max() < n), "a number out of range"
    cell_kernels(mesh)
    return mesh.vertices, mesh.face_offsets, mesh.face_vertices, mesh.cell_offsets, mesh.cell_faces


def read_folder(path):
    """One damaged cell beside a sound one, which must keep its place."""
    from voxkernel import read_polyhedral

    folder = path.parent / "cells"
    folder.mkdir(exist_ok=True)
    shutil.copyfile(path, folder / "1.off")
    (folder / "0.off").write_bytes(off_text(*shapes.cube()))
    mesh = read_polyhedral(folder)
    assert len(mesh) == 2, "a cell was lost"
    assert mesh.problems[0] == "", "a sound cell has a problem"
    assert "\n" not in mesh.problems[1], "a problem of several lines"
    return mesh.vertices, mesh.face_vertices


TETRAHEDRA = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], [[0, 1, 2, 3], [1, 2, 3, 4]])
CELLS = {  # number of VTK, corners
    10: [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    12: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
    13: [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)],
    14: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1)],
}
MEDIT = {10: "Tetrahedra", 12: "Hexahedra", 13: "Prisms", 14: "Pyramids"}


def hedra_seeds():
    """Two tetrahedra that share a face, and a prism of polygons."""
    points = np.array(TETRAHEDRA[0], float) + THIRDS
    faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3], [1, 2, 4], [2, 3, 4], [3, 1, 4]]
    meshes = [(points, faces, [[0, 1, 2, 3], [3, 4, 5, 6]])]
    vertices, polygons = next(bodies())
    meshes.append((vertices, polygons, [list(range(len(polygons)))]))
    found = []
    for v, f, c in meshes:
        rows = [f"{len(v)} {len(f)} {len(c)}", *(row_text(p) for p in v.tolist())]
        rows += [" ".join(map(str, (len(p), *(k + 1 for k in p)))) for p in f]
        rows += [" ".join(map(str, (len(p), *((k + 1) * (-1) ** k for k in p)))) for p in c]
        found.append(("\n".join(rows) + "\n").encode())
    return found


def same_hedra(rng, data):
    lines = data.decode().splitlines()
    for k in range(1, 1 + int(lines[0].split()[0])):
        lines[k] = " ".join(fm.same_float(rng, word) for word in lines[k].split())
    return fm.same_spaces(rng, "\n".join(lines), rng.choice(("# 1 2 3", ""))).encode()


def all_cells():
    """Points of cells of every kind, apart from each other, and each cell's VTK number and ids."""
    points, cells = [], []
    for kind, corners in CELLS.items():
        cells.append((kind, list(range(len(points), len(points) + len(corners)))))
        points += [(x + 3 * len(cells), y + THIRDS, z) for x, y, z in corners]
    return points, cells


def medit_seeds():
    points, cells = all_cells()
    rows = [
        "MeshVersionFormatted 2",
        "Dimension 3",
        "Vertices",
        str(len(points)),
        *(row_text(p) + " 0" for p in points),
    ]
    rows += ["Triangles 1", "1 2 3 0"]
    for kind, ids in cells:
        rows += [MEDIT[kind], "1", " ".join(str(k + 1) for k in ids) + " 7"]
    rows += ["RequiredVertices", "1", "1", "End"]
    tets = ["MeshVersionFormatted 1", "Dimension", "3", "Vertices 5", *(f"{a} {b} {c} 1" for a, b, c in TETRAHEDRA[0])]
    tets += ["Tetrahedra 2", *(" ".join(str(k + 1) for k in ids) + " 0" for ids in TETRAHEDRA[1]), "End"]
    return ["\n".join(lines).encode() + b"\n" for lines in (rows, tets)]


def same_medit(rng, data):
    lines = [
        " ".join([fm.same_float(rng, w) for w in line.split()[:3]] + line.split()[3:]) if "." in line else line
        for line in data.decode().splitlines()
    ]
    text = fm.same_spaces(rng, "\n".join(lines), rng.choice(("# Vertices 9", "")))
    return text.encode() if rng.random() < 0.5 else " ".join(re.sub("#.*", "", text).split()).encode()


@cache
def vtu_seeds():
    """Each of VTK's ways to hold an array: text, base64, appended raw, and three codecs; polyhedra and other cells."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkIdList, vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkUnstructuredGrid
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    def written(grid, setting, codec):
        writer = vtkXMLUnstructuredGridWriter()
        writer.SetInputData(grid)
        writer.SetWriteToOutputString(True)
        getattr(writer, f"SetDataModeTo{setting}")()
        writer.SetCompressorTypeToNone() if codec == "None" else getattr(writer, f"SetCompressorTypeTo{codec}")()
        if setting == "Appended":
            writer.SetEncodeAppendedData(False)
        writer.Write()
        text = writer.GetOutputString()
        return text if isinstance(text, bytes) else text.encode()

    def grid_of(points, cells):
        grid = vtkUnstructuredGrid()
        places = vtkPoints()
        places.SetData(numpy_to_vtk(np.asarray(points, float), deep=True))
        grid.SetPoints(places)
        for kind, ids in cells:
            row = vtkIdList()
            for k in ids:
                row.InsertNextId(k)
            grid.InsertNextCell(kind, row)
        return grid

    mixed = grid_of(*all_cells())
    vertices, polygons = next(bodies())
    prism = [len(polygons), *(k for p in polygons for k in (len(p), *p))]
    round_one = [4, 3, 12, 14, 13, 3, 12, 13, 15, 3, 12, 15, 14, 3, 13, 14, 15]
    points = [*vertices.tolist(), *((x + 9, y, z) for x, y, z in CELLS[10])]
    polyhedra = grid_of(points, [(42, prism), (42, round_one), (5, [0, 1, 2])])
    ways = [("Ascii", "None"), ("Binary", "None"), ("Binary", "ZLib"), ("Binary", "LZ4"), ("Binary", "LZMA")]
    found = [written(grid, *way) for grid in (mixed, polyhedra) for way in ways]
    return found + [written(grid, "Appended", "None") for grid in (mixed, polyhedra)]


VTU_WORDS = (
    "UnstructuredGrid", "Piece", "NumberOfCells", "NumberOfPoints", "Points", "Cells", "DataArray", "connectivity",
    "offsets", "types", "faces", "faceoffsets", "Int64", "Int8", "UInt8", "Float64", "Float32", "ascii", "binary",
    "appended", "format", "NumberOfComponents", "header_type", "UInt32", "UInt64", "BigEndian", "compressor", "String",
    "vtkZLibDataCompressor", "vtkLZ4DataCompressor", "PointData", "CellData", "PolyData", "face_connectivity",
)  # fmt: skip
_ARRAY = re.compile(rb"(<DataArray[^>]*>)([^<]*)")


def damage_vtu(rng, data):
    kind = rng.randrange(4)
    if kind == 0:  # a count or a kind in an attribute
        hits = list(re.finditer(rb'="([^"]*)"', data))
        hit = rng.choice(hits)
        counts = [h for h in hits if h[1].isdigit()]
        if counts and rng.random() < 0.7:
            hit = rng.choice(counts)
        old = hit[1].decode()
        choices = [*fm.NASTY_WORDS, rng.choice(VTU_WORDS)]
        if old.isdigit():
            choices += [str(int(old) + k) for k in (-1, 1, 2, 100)] * 5
        return data[: hit.start(1)] + rng.choice(choices).encode() + data[hit.end(1) :]
    arrays = list(_ARRAY.finditer(data))
    if kind == 1 and arrays:  # a number of an array, in whatever way it is packed
        hit = rng.choice(arrays)
        text = hit[2].strip()
        if b'format="ascii"' in hit[1]:
            text = fm.damage_text(rng, text)
        elif b'format="binary"' in hit[1]:
            text = _damage_packed(rng, text, b"vtkZLibDataCompressor" in data, b"compressor=" in data)
        return data[: hit.start(2)] + b"\n" + text + b"\n" + data[hit.end(2) :]
    if kind == 2:
        return damage_xml_with(rng, data, VTU_WORDS)
    return fm.damage_bytes(rng, data)


def damage_xml_with(rng, data, words):
    return fm.damage_text(rng, data, words, ("<a>", "<DataArray>", "<Piece>", "<!--", "&amp;", "<"))


def _damage_items(rng, raw):
    return fm.damage_bytes(rng, raw, [(0, 4)] * 3 + [(k, 8) for k in range(4, len(raw) - 7, 8)])


def _damage_packed(rng, text, is_zlib, is_packed):
    """An array in base64: its header of sizes, or its items behind the codec."""
    if not is_packed:
        return fm.damage_base64(rng, text, _damage_items)
    try:
        head = base64.b64decode(text[:24])
        blocks = int.from_bytes(head[:4], "little")
        n_head = 4 * (3 + blocks)
        cut = -(-n_head // 3) * 4
        head, body = base64.b64decode(text[:cut]), base64.b64decode(text[cut:])
        if is_zlib and blocks == 1 and rng.random() < 0.6:
            raw = fm.damage_bytes(rng, zlib.decompress(body), [(k, 8) for k in range(0, 64, 8)])
            body = zlib.compress(raw)
            size = len(raw) if rng.random() < 0.7 else int.from_bytes(head[4:8], "little")
            head = struct.pack("<4I", 1, size, size if rng.random() < 0.5 else 0, len(body))
        elif rng.random() < 0.6:
            head = fm.damage_bytes(rng, head, [(4 * k, 4) for k in range(n_head // 4)])
        else:
            body = fm.damage_bytes(rng, body)
        return base64.b64encode(head) + base64.b64encode(body)
    except (ValueError, zlib.error, struct.error):
        return fm.damage_base64(rng, text)


def same_vtu(rng, data):
    comment = rng.choice((b"<!-- none -->\n", b"<!-- <Piece NumberOfCells='-1'> -->\n", b"\n\n"))
    at = data.find(b"<UnstructuredGrid")
    return data[:at] + comment + data[at:]
