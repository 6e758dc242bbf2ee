"""Surface files for the fuzzing: sound ones, how to damage them, and others that say the same."""

import re
import struct
import zlib
from functools import cache

import fuzz_mutations as fm
import numpy as np
import shapes

THIRDS = 1 / 3  # coordinates that need all digits of a double


def read_surface(path):
    from voxkernel import as_mesh

    mesh = as_mesh(path)
    if zlib.crc32(path.read_bytes()) % 4 == 0:  # they take as long as all the rest
        mesh.facts()
    assert np.isfinite(mesh.vertices).all(), "a coordinate is not finite"
    assert len(mesh.faces), "a mesh without faces"
    for ids in (mesh.faces, mesh.plane_corners):
        assert ids.min() >= 0, "a vertex number below 0"
        assert ids.max() < len(mesh.vertices), "a vertex number beyond the vertices"
    for ids in (mesh.facet_ids, mesh.plane_facets):
        assert (np.diff(ids) >= 0).all(), "facet numbers are not ascending"
        assert ids[0] >= 0, "a facet number below 0"
        assert ids[-1] < mesh.n_input_facets, "a facet number beyond the input"
    return mesh.vertices, mesh.faces, mesh.facet_ids, np.array([mesh.n_input_facets])


def bodies():
    """A prism of polygons and an octahedron of triangles; coordinates need all digits."""
    vertices, polygons = shapes.prism_polygons([(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2)])
    yield np.asarray(vertices, float) + THIRDS, [list(map(int, p)) for p in polygons]
    vertices, faces = shapes.octahedron()
    yield np.asarray(vertices, float) * 1.1, np.asarray(faces).tolist()


@cache
def vtp_seeds():
    """Each of VTK's ways to hold an array, by VTK; and ours."""
    import tempfile
    from pathlib import Path

    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter

    from voxkernel import as_mesh

    seeds = []
    for body in bodies():
        mesh = as_mesh(body)
        for setting in ("Ascii", "Binary", "Appended"):
            writer = vtkXMLPolyDataWriter()
            writer.SetInputData(mesh.to_polydata())
            writer.SetWriteToOutputString(True)
            getattr(writer, f"SetDataModeTo{setting}")()
            writer.Write()
            text = writer.GetOutputString()
            seeds.append(text if isinstance(text, bytes) else text.encode())
        with tempfile.TemporaryDirectory() as folder:
            mesh.write(Path(folder) / "a.vtp")
            seeds.append((Path(folder) / "a.vtp").read_bytes())
    return seeds


def row_text(values):
    return " ".join(map(repr, values))


PLY_BITS = {"uchar": "B", "int": "i", "uint": "I", "short": "h", "ushort": "H"}


def ply_file(order, vertices, faces, count="uchar", index="int", name="vertex_indices", extras=True):
    real = "double"
    head = ["ply", f"format {'ascii' if not order else 'binary_' + order + '_endian'} 1.0", "comment by formula"]
    head += [f"element vertex {len(vertices)}", *(f"property {real} {c}" for c in "xyz")]
    head += ["property uchar red"] if extras else []
    head += [f"element face {len(faces)}", f"property list {count} {index} {name}"]
    if extras:
        head += ["property list uchar float texcoord", "property short flag", "element edge 1", "property int vertex1"]
    text = "\n".join([*head, "end_header"]) + "\n"
    if not order:
        rows = [row_text(v) + (" 200" if extras else "") for v in vertices.tolist()]
        rows += [" ".join(map(str, (len(f), *f))) + (" 2 0.5 0.25 -7" if extras else "") for f in faces]
        return (text + "\n".join(rows + (["1"] if extras else [])) + "\n").encode()
    mark = "<" if order == "little" else ">"
    body = b""
    for v in vertices.tolist():
        body += struct.pack(mark + "3d", *v) + (b"\xc8" if extras else b"")
    for f in faces:
        body += struct.pack(mark + PLY_BITS[count] + f"{len(f)}{PLY_BITS[index]}", len(f), *f)
        body += struct.pack(mark + "B2fh", 2, 0.5, 0.25, -7) if extras else b""
    return text.encode() + body + (struct.pack(mark + "i", 1) if extras else b"")


def ply_seeds(order):
    kinds = (
        ("uchar", "int", "vertex_indices", True),
        ("int", "uint", "vertex_index", False),
        ("ushort", "short", "vertex_indices", True),
    )
    return [ply_file(order, *body, *kind) for body in bodies() for kind in kinds]


PLY_WORDS = (
    "element", "property", "list", "vertex", "face", "edge", "format", "ascii", "binary_little_endian", "comment",
    "binary_big_endian", "char", "uchar", "short", "ushort", "int", "uint", "float", "double", "int64", "uint64", "x",
    "y", "z", "vertex_indices", "end_header", "obj_info", "tristrips", "1.0",
)  # fmt: skip


def damage_ply(rng, data):
    split = data.find(b"end_header") + 11
    head, body = data[:split], data[split:]
    if b"format ascii" in head and rng.random() < 0.5:
        return fm.damage_text(rng, data, PLY_WORDS)
    if rng.random() < 0.55:
        head = fm.damage_text(rng, head, PLY_WORDS)
        if rng.random() < 0.7:
            return head + body
    if b"format ascii" in data[:split]:
        return head + fm.damage_text(rng, body, PLY_WORDS)
    return head + fm.damage_bytes(rng, body, ply_fields(data, split))


def ply_fields(data, split):
    """Offsets of coordinates and list sizes of the files made here."""
    head = data[:split].decode()
    n = int(re.search(r"element vertex (\d+)", head)[1])
    has_extras = "property uchar red" in head
    count, index = re.search(r"property list (\w+) (\w+)", head).groups()
    step = 24 + has_extras
    fields = [(step * k + 8 * axis, 8) for k in range(n) for axis in range(3)]
    at = step * n
    count_bytes, index_bytes = struct.calcsize(PLY_BITS[count]), struct.calcsize(PLY_BITS[index])
    order = "little" if "little" in head else "big"
    while at + count_bytes < len(data) - split:
        fields += [(at, count_bytes)] * 6
        size = int.from_bytes(data[split + at : split + at + count_bytes], order)
        fields += [(at + count_bytes + index_bytes * k, index_bytes) for k in range(size)]
        at += count_bytes + size * index_bytes
        if has_extras:
            fields += [(at, 1)] * 3
            at += 11
    return fields


def same_ply(rng, data):
    split = data.find(b"end_header") + 11
    head, body = data[:split].decode(), data[split:]
    lines = head.splitlines()
    for _ in range(rng.randrange(3)):
        lines.insert(rng.randrange(2, len(lines)), rng.choice(("comment element vertex 9", "obj_info made", "comment")))
    lines = [line if line == "ply" else line.replace(" ", rng.choice((" ", "  "))) for line in lines]
    if b"format ascii" not in data:
        return ("\n".join(lines) + "\n").encode() + body
    n = int(re.search(r"element vertex (\d+)", head)[1])
    rows = body.decode().splitlines()
    for k in range(n):
        words = rows[k].split()
        rows[k] = " ".join([fm.same_float(rng, w) for w in words[:3]] + words[3:])
    end = rng.choice(("\n", "\r\n"))
    return (end.join(lines) + end + fm.same_spaces(rng, "\n".join(rows), ends=(end,))).encode()


def off_text(vertices, polygons, head="OFF", tail=""):
    rows = [row_text(v) + tail for v in np.asarray(vertices, float).tolist()]
    rows += [" ".join(map(str, (len(p), *map(int, p)))) for p in polygons]
    return (f"{head}\n{len(vertices)} {len(polygons)} 0\n" + "\n".join(rows) + "\n").encode()


def off_seeds():
    kinds = (("OFF",), ("NOFF", " 0 0 1"), ("COFF", " 255 0 0 255"))
    return [off_text(*body, *kind) for body in bodies() for kind in kinds]


def same_off(rng, data):
    lines = data.decode().splitlines()
    n = int(lines[1].split()[0])
    for k in range(2, 2 + n):
        lines[k] = " ".join(fm.same_float(rng, word) for word in lines[k].split())
    return fm.same_spaces(rng, "\n".join(lines), rng.choice(("# 3 0 1 2", "", "   #"))).encode()


def obj_seeds():
    found = []
    for vertices, polygons in bodies():
        rows = ["# by formula", "mtllib none.mtl", "o body"] + [f"v {row_text(v)}" for v in vertices.tolist()]
        plain = ["f " + " ".join(str(k + 1) for k in p) for p in polygons]
        relative = ["f " + " ".join(str(k - len(vertices)) for k in p) for p in polygons]
        slashes = ["vt 0 0", "vn 0 0 1", "g a"] + ["f " + " ".join(f"{k + 1}/1/1" for k in p) for p in polygons]
        normals = ["vn 0 0 1", "usemtl m"] + ["f " + " ".join(f"{k + 1}//1" for k in p) for p in polygons]
        found += ["\n".join(rows + faces) + "\n" for faces in (plain, relative, slashes, normals)]
    return [text.encode() for text in found]


def same_obj(rng, data):
    lines = [
        "v " + " ".join(fm.same_float(rng, w) for w in line.split()[1:]) if line.startswith("v ") else line
        for line in data.decode().splitlines()
    ]
    return fm.same_spaces(rng, "\n".join(lines), rng.choice(("# f 1 2 3", "g group", "s 1", ""))).encode()


def stl_text(vertices, faces):
    rows = ["solid formula"]
    for face in faces:
        rows += [" facet normal 0 0 1", "  outer loop", *(f"   vertex {row_text(vertices[k].tolist())}" for k in face)]
        rows += ["  endloop", " endfacet"]
    return ("\n".join(rows) + "\nendsolid formula\n").encode()


def stl_binary(vertices, faces):
    body = b"".join(struct.pack("<12fH", 0, 0, 1, *(float(x) for k in face for x in vertices[k]), 0) for face in faces)
    return b"by formula".ljust(80) + struct.pack("<I", len(faces)) + body


def triangles():
    vertices, faces = shapes.octahedron()
    yield np.asarray(vertices, float) * THIRDS, np.asarray(faces)
    vertices, faces = shapes.l_prism()
    yield np.asarray(vertices, float), np.asarray(faces)


def stl_text_seeds():
    return [stl_text(*body) for body in triangles()]


def stl_binary_seeds():
    return [stl_binary(*body) for body in triangles()]


def damage_stl_binary(rng, data):
    n = int.from_bytes(data[80:84], "little")
    fields = [(80, 4)] * 30 + [(84 + 50 * k + 12 + 4 * j, 4) for k in range(n) for j in range(9)]
    return fm.damage_bytes(rng, data, fields)


def same_stl_text(rng, data):
    lines = data.decode().splitlines()
    for k, line in enumerate(lines):
        if "vertex" in line:
            lines[k] = "vertex " + " ".join(fm.same_float(rng, w) for w in line.split()[1:])
    return fm.same_spaces(rng, "\n".join(line.strip() for line in lines)).encode()


def same_stl_binary(rng, data):
    """Header, normals and attributes have no say."""
    out = bytearray(data)
    out[:80] = rng.choice((b"solid".ljust(80), rng.randbytes(80)))
    for at in range(84, len(out), 50):
        out[at : at + 12] = rng.randbytes(12)
        out[at + 48 : at + 50] = rng.randbytes(2)
    return bytes(out)
