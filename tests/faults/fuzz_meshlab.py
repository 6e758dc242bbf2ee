"""Files of the types that PyMeshLab reads, for the fuzzing."""

import base64
import json
import os
import re
import struct
import tempfile
from functools import cache
from pathlib import Path
from unittest import mock

import fuzz_mutations as fm
import numpy as np
from fuzz_surfaces import read_surface, row_text, triangles


@cache
def reader_of(process):
    """One child of a process for all its inputs: an interpreter for each would cost a second."""
    from voxkernel.mesh.other_formats import MeshlabReader

    return MeshlabReader(seconds=1)


def read_surface_in_child(path):
    with mock.patch("voxkernel.mesh.other_formats.read_with_meshlab", reader_of(os.getpid()).read):
        return read_surface(path)


@cache
def written_by_pymeshlab(suffix):
    import pymeshlab

    found = []
    for vertices, faces in triangles():
        meshes = pymeshlab.MeshSet()
        meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / f"a{suffix}"
            meshes.save_current_mesh(str(file))
            data = file.read_bytes()
        found.append(re.sub(rb"<(created|modified)>[^<]*", rb"<\1>2026-11-22T08:00:00Z", data))
    return found


def fields_3ds(data):
    """Identifier and length of each chunk, and counts behind them."""
    fields = []
    parents = {0x4D4D, 0x3D3D, 0x4000, 0x4100}

    def walk(at, end):
        while at + 6 <= end:
            kind, size = struct.unpack_from("<HI", data, at)
            fields.extend([(at, 2), (at + 2, 4), (at + 6, 2)])
            body = at + 6
            if kind == 0x4000:
                body = data.find(b"\0", body) + 1
            if kind in parents:
                walk(body, min(end, at + size))
            at += max(size, 6)

    walk(0, len(data))
    return fields


def damage_3ds(rng, data):
    return fm.damage_bytes(rng, data, fields_3ds(data))


def ctm_seeds():
    """OpenCTM files without a codec, so that damage reaches the numbers, and with one, as PyMeshLab writes them."""
    raw = []
    for vertices, faces in triangles():
        head = b"OCTM" + struct.pack("<I4s6I", 5, b"RAW\0", len(vertices), len(faces), 0, 0, 0, 7) + b"formula"
        body = b"INDX" + np.asarray(faces, "<u4").tobytes() + b"VERT" + np.asarray(vertices, "<f4").tobytes()
        raw.append(head + body)
    return raw + written_by_pymeshlab(".ctm")


def damage_ctm(rng, data):
    return fm.damage_bytes(rng, data, [(4 * k, 4) for k in range(12)])


def damage_3mf(rng, data):
    return fm.damage_zip(rng, data, lambda rng, name, content: damage_xml(rng, content))


XML_WORDS = (
    "mesh", "vertices", "vertex", "triangles", "triangle", "v1", "x", "object", "item", "count", "source", "stride",
    "offset", "input", "p", "coordIndex", "point", "VERTEX", "POSITION", "accessor", "triangles", "polylist", "vcount",
    "IndexedFaceSet", "Coordinate", "USE", "DEF", "IndexedTriangleSet", "ElevationGrid", "Transform", "Inline", "url",
)  # fmt: skip
VRML_WORDS = (
    "Shape", "geometry", "IndexedFaceSet", "coord", "Coordinate", "point", "coordIndex", "DEF", "USE", "PROTO", "Box",
    "Transform", "children", "Inline", "url", "Sphere", "Extrusion", "ElevationGrid", "Text", "NULL", "ROUTE", "Script",
)  # fmt: skip


def damage_xml(rng, data):
    return fm.damage_text(rng, data, XML_WORDS, ("<a>", "<a", "<!--", "<![CDATA[", "&amp;", "<!DOCTYPE a ["))


def damage_vrml(rng, data):
    return fm.damage_text(rng, data, VRML_WORDS, ("[", "{", "Transform { children [ ", '"'))


def x3dv_seeds():
    found = []
    for vertices, faces in triangles():
        points = " ".join(row_text(v) for v in vertices.tolist())
        ids = " ".join(f"{a} {b} {c} -1" for a, b, c in faces)
        coord = f"coord Coordinate {{\n   point [ {points} ]\n  }}"
        shape = f"Shape {{\n geometry IndexedFaceSet {{\n  {coord}\n  coordIndex [ {ids} ]\n }}\n}}\n"
        found.append(f"#X3D V3.0 utf8\nPROFILE Immersive\n{shape}".encode())
    return found


def fbx_seeds():
    found = []
    for vertices, faces in triangles():
        points = ",".join(map(repr, vertices.reshape(-1).tolist()))
        ids = ",".join(f"{a},{b},{-c - 1}" for a, b, c in faces)
        geometry = f'\tGeometry: 1000, "Geometry::", "Mesh" {{\n\t\tVertices: *{vertices.size} {{\n'
        geometry += f"\t\t\ta: {points}\n\t\t}}\n\t\tPolygonVertexIndex: *{faces.size} {{\n"
        geometry += f"\t\t\ta: {ids}\n\t\t}}\n\t\tGeometryVersion: 124\n\t}}\n"
        found.append(
            "; FBX 7.3.0 project file\nFBXHeaderExtension:  {\n\tFBXHeaderVersion: 1003\n\tFBXVersion: 7300\n}\n"
            f'Objects:  {{\n{geometry}\tModel: 2000, "Model::Solid", "Mesh" {{\n\t\tVersion: 232\n\t}}\n}}\n'
            'Connections:  {\n\tC: "OO",2000,0\n\tC: "OO",1000,2000\n}\n'
        )
    return [text.encode() for text in found]


def gltf_document(vertices, faces, uri):
    points, ids = np.asarray(vertices, "<f4").tobytes(), np.asarray(faces, "<u2").tobytes()
    body = ids + b"\0" * (-len(ids) % 4) + points
    buffer = {"byteLength": len(body)}
    if uri:
        buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(body).decode()
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "matrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 1}, "indices": 0, "mode": 4}]}],
        "buffers": [buffer],
        "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": len(ids)},
                        {"buffer": 0, "byteOffset": len(body) - len(points), "byteLength": len(points)}],
        "accessors": [
            {"bufferView": 0, "byteOffset": 0, "componentType": 5123, "count": int(faces.size), "type": "SCALAR"},
            {"bufferView": 1, "byteOffset": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3",
             "min": vertices.min(0).tolist(), "max": vertices.max(0).tolist()},
        ],
    }  # fmt: skip
    return document, body


def gltf_seeds():
    return [json.dumps(gltf_document(*body, uri=True)[0]).encode() for body in triangles()]


def glb_bytes(text, body):
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def glb_seeds():
    found = []
    for shape in triangles():
        document, body = gltf_document(*shape, uri=False)
        found.append(glb_bytes(json.dumps(document).encode(), body))
    return found


def damage_glb(rng, data):
    n = int.from_bytes(data[12:16], "little")
    text, body = data[20 : 20 + n], data[28 + n :]
    kind = rng.randrange(3)
    if kind == 0:
        return glb_bytes(fm.damage_json_text(rng, text), body)
    if kind == 1:
        return glb_bytes(text, fm.damage_bytes(rng, body))
    return fm.damage_bytes(rng, data, [(0, 4), (4, 4), (8, 4), (12, 4), (16, 4), (20 + n, 4), (24 + n, 4)])


def same_vrml(rng, data):
    first, rest = data.decode().split("\n", 1)
    return (first + "\n" + fm.same_spaces(rng, rest, rng.choice(("# point [ 1 ]", "")), ends=("\n",))).encode()
