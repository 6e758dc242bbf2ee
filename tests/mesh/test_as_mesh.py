import re
import struct
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest
import shapes

from voxkernel import _open3d
from voxkernel.errors import MeshError, MeshReadError
from voxkernel.mesh import TriangleMesh, as_mesh
from voxkernel.mesh.files import Polygons, merge_equal_corners

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
PYRAMID = np.array([[0.1, 0, 0], [1, 1 / 3, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.4, 2 / 7]])
SIDES = [(3, 2, 1, 0), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)]


def same_arrays(mesh, vertices, faces):
    assert mesh.vertices.dtype == np.float64
    np.testing.assert_array_equal(mesh.vertices, np.asarray(vertices))
    np.testing.assert_array_equal(mesh.faces, np.asarray(faces))


def is_the_pyramid(mesh, vertices=PYRAMID):
    np.testing.assert_array_equal(mesh.vertices, vertices)
    assert mesh.n_facets == 5
    for facet, corners in enumerate(SIDES):
        assert set(mesh.faces[mesh.facet_ids == facet].reshape(-1).tolist()) == set(corners)
    assert mesh.facts().is_closed
    assert mesh.facts().is_oriented


# ---------------------------------------------------------------- arrays and foreign types


def test_a_mesh_is_returned_as_it_is():
    mesh = TriangleMesh.from_triangles(*shapes.cube())
    assert as_mesh(mesh) is mesh
    assert as_mesh(mesh, facets=[3]).facet_ids.tolist() == [3]


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32])
def test_pairs_of_arrays(dtype):
    vertices, faces = shapes.cube()
    given = vertices.astype(dtype)
    same_arrays(as_mesh((given, faces)), vertices, faces)
    same_arrays(as_mesh([given.tolist(), faces.tolist()]), vertices, faces)
    assert given.flags.writeable
    assert faces.flags.writeable


def test_pairs_with_polygons():
    is_the_pyramid(as_mesh((PYRAMID, SIDES)))
    is_the_pyramid(as_mesh((PYRAMID, [np.array(side) for side in SIDES])))
    ragged = np.empty(5, dtype=object)
    ragged[:] = SIDES
    is_the_pyramid(as_mesh((PYRAMID, ragged)))
    quads = as_mesh((SQUARE, np.array([[0, 1, 2, 3]])))
    assert quads.n_facets == 1
    assert len(quads.plane_corners) == 1
    bent = [[0, 0, 0], [1, 0, 0], [1, 1, 1e-6], [0, 1, 0]]
    assert len(as_mesh((bent, [[0, 1, 2, 3]])).nonplanar_facets) == 1
    assert len(as_mesh((bent, [[0, 1, 2, 3]]), planarity_rtol=1e-3).nonplanar_facets) == 0


def test_pairs_that_are_refused():
    with pytest.raises(MeshError, match=r"`faces` must have shape \(m, k\); got \(3,\)"):
        as_mesh((SQUARE, np.arange(3)))
    with pytest.raises(MeshError, match="at least 3 corners"):
        as_mesh((SQUARE, np.array([[0, 1]])))
    with pytest.raises(TypeError, match="array of integers"):
        as_mesh((SQUARE, np.array([[0.0, 1.0, 2.0]])))
    with pytest.raises(MeshError, match="`vertices` must have shape"):
        as_mesh(([1.0, 2.0, 3.0], [[0, 1, 2]]))
    with pytest.raises(MeshError, match="finite"):
        as_mesh((np.full((3, 3), np.nan), [[0, 1, 2, 0]]))


@pytest.mark.parametrize("wrong", [None, 3, np.zeros((3, 3)), (1, 2, 3), object()])
def test_other_types_are_refused(wrong):
    accepted = "`mesh` must be a path, a TriangleMesh, a pair .* Open3D .* trimesh, PyVista .* meshio; got "
    with pytest.raises(TypeError, match=accepted) as info:
        as_mesh(wrong)
    assert "\n" not in str(info.value)


def test_open3d_meshes():
    o3d = _open3d.open3d()
    vertices, faces = shapes.l_prism()
    vertices = vertices + 1 / 3
    legacy = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(faces)
    )
    same_arrays(as_mesh(legacy), vertices, faces)
    assert as_mesh(legacy).source == "open3d.geometry.TriangleMesh"
    tensor = o3d.t.geometry.TriangleMesh(o3d.core.Tensor(vertices), o3d.core.Tensor(faces))
    same_arrays(as_mesh(tensor), vertices, faces)
    assert as_mesh(tensor).source == "open3d.t.geometry.TriangleMesh"
    with pytest.raises(MeshError, match="at least one triangle; got 0"):
        as_mesh(o3d.geometry.TriangleMesh())
    with pytest.raises(MeshError, match=r"`mesh` must have vertex\.positions"):
        as_mesh(o3d.t.geometry.TriangleMesh())
    with pytest.raises(TypeError, match=r"got open3d.*PointCloud"):
        as_mesh(o3d.geometry.PointCloud())


def test_trimesh_meshes():
    trimesh = pytest.importorskip("trimesh")
    vertices, faces = shapes.l_prism()
    same_arrays(as_mesh(trimesh.Trimesh(vertices, faces, process=False)), vertices, faces)


def test_trimesh_scenes_of_one_mesh():
    trimesh = pytest.importorskip("trimesh")
    vertices, faces = shapes.l_prism()
    one = trimesh.Trimesh(vertices, faces, process=False)
    same_arrays(as_mesh(trimesh.Scene(one)), vertices, faces)
    placed = trimesh.Scene()
    motion = np.array([[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1.0]])
    placed.add_geometry(one, transform=motion)
    same_arrays(as_mesh(placed), vertices @ motion[:3, :3].T + motion[:3, 3], faces)
    placed.add_geometry(one)
    with pytest.raises(MeshError, match="scene of one mesh, placed once; got 2 meshes, 2 geometries and 2 places"):
        as_mesh(placed)
    with pytest.raises(MeshError, match="scene of one mesh, placed once; got 0 meshes"):
        as_mesh(trimesh.Scene())


def test_meshlab_meshes():
    pymeshlab = pytest.importorskip("pymeshlab")
    vertices, faces = shapes.l_prism()
    meshes = pymeshlab.MeshSet()
    with pytest.raises(MeshError, match="MeshSet of one mesh; got 0"):
        as_mesh(meshes)
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    same_arrays(as_mesh(meshes), vertices, faces)
    same_arrays(as_mesh(meshes.current_mesh()), vertices, faces)
    meshes.add_mesh(pymeshlab.Mesh(vertices))
    with pytest.raises(MeshError, match="MeshSet of one mesh; got 2"):
        as_mesh(meshes)
    with pytest.raises(MeshError, match=f"must have triangles; got {len(vertices)} vertices without"):
        as_mesh(meshes.current_mesh())


def test_dicts_of_arrays():
    vertices, faces = shapes.l_prism()
    same_arrays(as_mesh({"vertices": vertices, "faces": faces, "colour": "red"}), vertices, faces)
    is_the_pyramid(as_mesh({"vertices": PYRAMID, "faces": SIDES}))
    with pytest.raises(TypeError, match="`faces` where it is a dict; got the keys 'vertices'"):
        as_mesh({"vertices": vertices})


def test_unstructured_grids_of_polygons(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    cells = np.concatenate([[2, 0, 4], *([len(side), *side] for side in SIDES)])
    grid = pyvista.UnstructuredGrid(cells, np.array([3, 9, 5, 5, 5, 5], np.uint8), PYRAMID)
    is_the_pyramid(as_mesh(grid))
    solid = pyvista.UnstructuredGrid(np.array([5, 0, 1, 2, 3, 4]), np.array([14], np.uint8), PYRAMID)
    with pytest.raises(MeshError, match=r"got 1 other cells, the first a pyramid \(grid\.extract_surface"):
        as_mesh(solid)
    with pytest.raises(MeshError, match="must have polygons; got 0 points"):
        as_mesh(pyvista.UnstructuredGrid())


@pytest.mark.parametrize("binary", [True, False])
def test_vtp_files_of_vtk(tmp_path, binary):
    pyvista = pytest.importorskip("pyvista")
    cells = np.concatenate([[len(side), *side] for side in SIDES])
    data = pyvista.PolyData(PYRAMID, faces=cells, lines=np.array([2, 0, 4]))
    data.save(tmp_path / "a.vtp", binary=binary)
    is_the_pyramid(as_mesh(tmp_path / "a.vtp"))
    pyvista.PolyData(PYRAMID, strips=np.array([4, 0, 1, 3, 2])).save(tmp_path / "strip.vtp")
    with pytest.raises(MeshReadError, match=r"not a readable \.vtp file: it has 1 triangle strips"):
        as_mesh(tmp_path / "strip.vtp")
    text = (tmp_path / "a.vtp").read_bytes()
    for old, new, match in (
        (b'type="PolyData"', b'type="ImageData"', "no VTKFile of type PolyData"),
        (b'NumberOfPolys="5"', b'NumberOfPolys="6"', "array 'offsets' has 5 values, not 6"),
        (b'Name="connectivity"', b'Name="connected"', "there are two arrays|there is no array"),
    ):
        (tmp_path / "b.vtp").write_bytes(text.replace(old, new))
        with pytest.raises(MeshReadError, match=match):
            as_mesh(tmp_path / "b.vtp")


@pytest.mark.parametrize("suffix", [".vtp", ".glb"])
def test_files_that_others_read(tmp_path, suffix):
    vertices, faces = shapes.l_prism()
    path = tmp_path / f"l{suffix}"
    as_mesh((vertices, faces)).write(path)
    if suffix == ".vtp":
        same_arrays(as_mesh(path), vertices, faces)
        theirs = pytest.importorskip("pyvista").read(path)
        np.testing.assert_array_equal(theirs.points, vertices)
        np.testing.assert_array_equal(theirs.regular_faces, faces)
    else:
        theirs = pytest.importorskip("trimesh").load(path, process=False)
        same_arrays(as_mesh(theirs), vertices.astype(np.float32), faces)
        assert as_mesh(path).facts().volume == pytest.approx(as_mesh((vertices, faces)).facts().volume, rel=1e-6)
    if suffix == ".glb":
        with pytest.raises(ValueError, match=r"must fit in float32 for \.glb"):
            as_mesh((vertices * 1e300, faces)).write(path)


def test_pyvista_meshes():
    pyvista = pytest.importorskip("pyvista")
    cells = np.concatenate([[len(side), *side] for side in SIDES])
    data = pyvista.PolyData(PYRAMID, faces=cells)
    is_the_pyramid(as_mesh(data))
    assert as_mesh(data).source == "pyvista.PolyData"
    rounded = pyvista.PolyData(PYRAMID.astype(np.float32), faces=cells)
    is_the_pyramid(as_mesh(rounded), PYRAMID.astype(np.float32))
    with_line = pyvista.PolyData(PYRAMID, faces=cells, lines=np.array([2, 0, 4]))
    is_the_pyramid(as_mesh(with_line))
    with pytest.raises(MeshError, match="`mesh` must have polygons"):
        as_mesh(pyvista.PolyData())
    with pytest.raises(MeshError, match="`mesh` must have polygons; got 5 points without"):
        as_mesh(pyvista.PolyData(PYRAMID))
    strip = pyvista.PolyData(PYRAMID, strips=np.array([4, 0, 1, 3, 2]))
    with pytest.raises(MeshError, match="triangle strips; got 1 "):
        as_mesh(strip)


def test_meshio_meshes():
    meshio = pytest.importorskip("meshio")
    cells = [("quad", np.array([SIDES[0]])), ("line", np.array([[0, 1]])), ("triangle", np.array(SIDES[1:]))]
    is_the_pyramid(as_mesh(meshio.Mesh(PYRAMID, cells)))
    hexagon = np.c_[np.cos(np.arange(6)), np.sin(np.arange(6)), np.zeros(6)]
    polygon = meshio.Mesh(hexagon, [("polygon", np.arange(6)[None])])
    assert as_mesh(polygon).n_facets == 1
    solid = meshio.Mesh(PYRAMID, [("tetra", np.array([[0, 1, 2, 4]]))])
    with pytest.raises(MeshError, match="got cells of type tetra"):
        as_mesh(solid)
    with pytest.raises(MeshError, match="polygons; got none"):
        as_mesh(meshio.Mesh(PYRAMID, [("vertex", np.array([[0]]))]))
    with pytest.raises(MeshError, match=r"`vertices` must have shape \(n, 3\); got \(5, 2\)"):
        as_mesh(meshio.Mesh(PYRAMID[:, :2], [("triangle", np.array(SIDES[1:]))]))


def test_foreign_arrays_stay_writeable():
    meshio = pytest.importorskip("meshio")
    mesh = meshio.Mesh(PYRAMID.copy(), [("quad", np.array([SIDES[0]]))])
    as_mesh(mesh)
    mesh.points[0] = 3.0
    assert mesh.cells[0].data.flags.writeable


# ---------------------------------------------------------------- files: polygons, float64, order


def numbers(values):
    return " ".join(repr(float(value)) for value in values)


def ply_text(name="vertex_indices", end="\n"):
    lines = [
        "ply", "format ascii 1.0", "comment made by hand", "obj_info none", "element camera 1",
        "property float view", f"element vertex {len(PYRAMID)}", "property double x", "property double y",
        "property uchar red", "property double z", f"element face {len(SIDES)}", "property int material",
        f"property list uchar int {name}", "property list uchar float texcoord", "end_header", "3.5",
    ]  # fmt: skip
    lines += [f"{x!r} {y!r} 255 {z!r}" for x, y, z in PYRAMID.tolist()]
    lines += [f"7 {len(side)} {' '.join(map(str, side))} 2 0.5 0.25" for side in SIDES]
    return end.join([*lines, ""]).encode()


def ply_binary(order, sides=SIDES, count="B", texture=True):
    word = {"<": "little", ">": "big"}[order]
    name = {"B": "uchar", "I": "uint32"}[count]
    head = [
        "ply", f"format binary_{word}_endian 1.0", "element camera 1", "property list uchar short view",
        f"element vertex {len(PYRAMID)}", "property float64 x", "property float64 y", "property uchar red",
        "property float64 z", f"element face {len(sides)}", "property int material",
        f"property list {name} uint vertex_index",
    ]  # fmt: skip
    head += ["property list uchar float texcoord"] if texture else []
    data = "\n".join([*head, "end_header", ""]).encode()
    data += struct.pack(order + "Bhh", 2, 5, 6)
    for x, y, z in PYRAMID.tolist():
        data += struct.pack(order + "ddBd", x, y, 200, z)
    for side in sides:
        data += struct.pack(f"{order}i{count}{len(side)}I", 7, len(side), *side)
        data += struct.pack(order + "Bff", 2, 0.5, 0.25) if texture else b""
    return data


@pytest.mark.parametrize(
    "data",
    [
        ply_text(),
        ply_text("vertex_index"),
        ply_text(end="\r\n"),
        ply_binary("<"),
        ply_binary(">"),
        ply_binary("<", count="I", texture=False),
    ],
    ids=["text", "other name", "crlf", "little", "big", "wide counts"],
)
def test_ply(tmp_path, data):
    path = tmp_path / "pyramid.PLY"
    path.write_bytes(data)
    is_the_pyramid(as_mesh(path))
    assert as_mesh(str(path)).source == str(path)


@pytest.mark.parametrize("order", "<>")
def test_ply_of_triangles_only(tmp_path, order):
    path = tmp_path / "sides.ply"
    path.write_bytes(ply_binary(order, SIDES[1:]))
    same_arrays(as_mesh(path), PYRAMID, SIDES[1:])


def test_ply_with_a_polygon_of_200_corners(tmp_path):
    angle = 2 * np.pi * np.arange(200) / 200
    ring = np.c_[np.cos(angle), np.sin(angle), np.zeros(200)]
    head = b"ply\nformat binary_little_endian 1.0\nelement vertex 200\nproperty double x\nproperty double y\n"
    head += b"property double z\nelement face 2\nproperty list uchar uchar vertex_indices\nend_header\n"
    path = tmp_path / "disc.ply"
    path.write_bytes(head + ring.tobytes() + bytes([200, *range(200), 3, 0, 2, 1]))
    mesh = as_mesh(path)
    assert mesh.n_facets == 2
    assert mesh.plane_areas[0] == pytest.approx(100 * np.sin(2 * np.pi / 200))


def test_ply_float32_is_read_exactly(tmp_path):
    meshio = pytest.importorskip("meshio")
    vertices, faces = shapes.icosphere(1)
    path = tmp_path / "ball.ply"
    meshio.Mesh(vertices.astype(np.float32), [("triangle", faces)]).write(path)
    same_arrays(as_mesh(path), vertices.astype(np.float32), faces)


OFF = "\n".join(
    ["OFF # a comment", "# another", "", "5 5 0", *map(numbers, PYRAMID), ""]
    + [f"{len(side)}  {' '.join(map(str, side))}" for side in SIDES]
)
OBJ = "\n".join(
    ["# comment", "mtllib x.mtl", "o thing", *("v " + numbers(row) for row in PYRAMID), "vn 0 0 1", "g a"]
    + ["usemtl red", "f " + " ".join(str(k + 1) for k in SIDES[0]), "g b", "s off", "l 1 2"]
    + ["f " + " ".join(str(k + 1) for k in side) for side in SIDES[1:]]
)


@pytest.mark.parametrize(
    ("suffix", "text"),
    [
        (".off", OFF),
        (".off", OFF.replace("OFF # a comment\n# another\n\n5 5 0", "OFF 5 5 0")),
        (".off", re.sub(r"(?m)^(\d  .*)$", r"\1 0.5 0.5 0.5", OFF.replace("OFF", "COFF"))),
        (".off", OFF.replace("\n", "\r\n")),
        (".obj", OBJ),
        (".obj", OBJ.replace("\n", "\r\n")),
        (".obj", re.sub(r"(?m)^f .*$", lambda m: re.sub(r"(\d+)", r"\1/9/\1", m[0]), OBJ)),
        (".obj", re.sub(r"(?m)^f .*$", lambda m: re.sub(r"(\d+)", r"\1//1", m[0]) + " # end", OBJ)),
        (".obj", re.sub(r"(?m)^f .*$", lambda m: re.sub(r"\d+", lambda k: str(int(k[0]) - 6), m[0]), OBJ)),
        (".obj", re.sub(r"(?m)^(v .*)$", r"\1 0.1 0.2 0.3", OBJ)),
        (".obj", re.sub(r"(?m)^(f \S+) ", r"\1 \\\n ", OBJ)),
        (".obj", re.sub(r"(?m)^(v|f) ", r"  \1\t", OBJ)),
    ],
)
def test_off_and_obj(tmp_path, suffix, text):
    path = tmp_path / f"pyramid{suffix}"
    path.write_text(text, newline="")
    is_the_pyramid(as_mesh(path))


def test_obj_relative_indices_count_from_where_they_stand(tmp_path):
    path = tmp_path / "two.obj"
    block = "v 0 0 {0}\nv 1 0 {0}\nv 0 1 {0}\nf -3 -2 -1\n"
    path.write_text(block.format(0) + block.format(1))
    assert as_mesh(path).faces.tolist() == [[0, 1, 2], [3, 4, 5]]


def test_stl_merges_equal_corners_and_says_so(tmp_path):
    vertices, faces = shapes.l_prism()
    corners = vertices[faces]
    text = "".join(
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {numbers(corner)}\n" for corner in triangle)
        + " endloop\nendfacet\n"
        for triangle in corners + 1 / 3
    )
    path = tmp_path / "text.stl"
    path.write_text(f"solid thing\n{text}endsolid thing\n")
    mesh = as_mesh(path)
    assert mesh.source == f"{path} (equal corners merged)"
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], corners + 1 / 3)
    assert len(mesh.vertices) == len(vertices)
    assert mesh.facts().is_closed
    binary = tmp_path / "binary.stl"
    rows = b"".join(np.r_[np.zeros(3), t.ravel()].astype("<f4").tobytes() + b"\1\0" for t in corners)
    binary.write_bytes(b"solid but binary".ljust(80) + struct.pack("<I", len(faces)) + rows)
    mesh = as_mesh(binary)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], corners)
    assert mesh.facts().is_closed


def test_merging_keeps_the_order_of_first_appearance():
    soup = Polygons(
        np.array([[5.0, 0, 0], [-0.0, 1, 2], [0.0, 1, 2], [5, 0, 0], [0, 0, 0]]), np.arange(5), np.array([5])
    )
    merged = merge_equal_corners(soup)
    assert merged.vertices.tolist() == [[5, 0, 0], [0, 1, 2], [0, 0, 0]]
    assert np.signbit(merged.vertices[1, 0])
    assert merged.flat.tolist() == [0, 1, 1, 0, 2]


WRL = """#VRML V2.0 utf8
Shape {{ geometry IndexedFaceSet {{
  coord Coordinate {{ point [ {points} ] }}
  coordIndex [ {indices} ]
}} }}
"""


def wrl_text():
    points = ", ".join(numbers(row) for row in np.float32(PYRAMID).tolist())
    return WRL.format(points=points, indices=" ".join(f"{' '.join(map(str, side))} -1" for side in SIDES[1:]))


def test_wrl(tmp_path, capfd):
    path = tmp_path / "face.wrl"
    path.write_text(wrl_text())
    same_arrays(as_mesh(path), np.float32(PYRAMID), SIDES[1:])
    assert capfd.readouterr() == ("", "")


def test_gltf(tmp_path, capfd):
    trimesh = pytest.importorskip("trimesh")
    vertices, faces = shapes.tetrahedron()
    body = trimesh.Trimesh(vertices, faces, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(body, node_name="a", transform=np.diag([2.0, 2.0, 2.0, 1.0]))
    scene.add_geometry(body, node_name="b", transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    scene.add_geometry(body, node_name="c", transform=np.diag([-1.0, 1.0, 1.0, 1.0]))
    scene.export(str(tmp_path / "scene.glb"))
    capfd.readouterr()
    mesh = as_mesh(tmp_path / "scene.glb")
    parts = [2 * vertices, vertices + np.array([5, 0, 0]), vertices * [-1, 1, 1]]
    assert sorted(mesh.vertices.tolist()) == sorted(np.concatenate(parts).tolist())
    facts = mesh.facts()
    assert facts.is_closed
    assert facts.is_outward  # the mirrored part too
    assert facts.volume == pytest.approx((8 + 1 + 1) / 6)
    for name, data in trimesh.exchange.gltf.export_gltf(body.scene()).items():
        (tmp_path / name).write_bytes(data)
    same_arrays(as_mesh(tmp_path / "model.gltf"), vertices, faces)
    assert capfd.readouterr() == ("", "")


# ---------------------------------------------------------------- files that are refused


def _ply(body, vertex="element vertex 3", face="element face 1"):
    head = f"ply\nformat ascii 1.0\n{vertex}\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"{face}\nproperty list uchar int vertex_indices\nend_header\n"
    return head + body


@pytest.mark.parametrize(
    ("name", "content", "kind", "text"),
    [
        ("a.ply", "", MeshReadError, "the file is empty"),
        ("a.off", " \n", MeshReadError, "the file is empty"),
        ("a.wrl", "", MeshReadError, "the file is empty"),
        ("a.txt", "OFF", MeshReadError, r"`path` must end in one of .*\.ply .*; got '.*a\.txt'"),
        ("noending", "OFF", MeshReadError, "`path` must end in one of"),
        ("a.ply", "solid", MeshReadError, "not a readable .ply file: it does not start with 'ply'"),
        ("a.ply", "ply\nformat ascii 1.0\n", MeshReadError, "no end_header"),
        ("a.ply", "ply\nelement vertex 3\nend_header\n", MeshReadError, "no format line"),
        ("a.ply", "ply\nformat ebcdic 1.0\nend_header\n", MeshReadError, "line 2: .* unknown word 'ebcdic 1.0'"),
        ("a.ply", _ply("0 0 0\n1 0 0\n"), MeshReadError, "ends before its 3 vertex elements do"),
        ("a.ply", _ply("0 0 0\n1 0 0\n0 1 0\n"), MeshReadError, "ends before its 1 face elements do"),
        ("a.ply", _ply("0 0 0\n1 0 0\n0 1 0\n3 0 1\n"), MeshReadError, "element face is too short"),
        ("a.ply", _ply("0 0 0\n1 0\n0 1 0\n3 0 1 2\n"), MeshReadError, "element vertex is too short"),
        ("a.ply", _ply("0 0 0\n1 0 x\n0 1 0\n3 0 1 2\n"), MeshReadError, "could not convert"),
        ("a.ply", _ply("0 0 0\n1 0 0\n0 1 0\n", face="element face 0"), MeshError, "facets; got 3 vertices"),
        ("a.ply", _ply("3 0 1 2", vertex="element vertex 0"), MeshError, "must hold vertices; got none"),
        ("a.ply", _ply("0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n"), MeshError, "must be finite; got nan in row 1"),
        ("a.ply", _ply("0 0 0\n1 0 inf\n0 1 0\n3 0 1 2\n"), MeshError, "`vertices` must be finite; got inf"),
        ("a.ply", _ply("0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"), MeshError, r"must be in 0\.\.2; got 3"),
        ("a.ply", _ply("0 0 0\n1 0 0\n0 1 0\n2 0 1\n"), MeshError, "at least 3 corners"),
        ("a.ply", _ply("0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n"), MeshError, "positive area"),
        ("a.off", "NOPE\n", MeshReadError, "does not start with 'OFF'"),
        ("a.off", "# only\n", MeshReadError, "only comments"),
        ("a.off", "OFF BINARY\n", MeshReadError, "binary OFF"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n", MeshReadError, "ends before its 3 vertices and 1 faces do"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n", MeshReadError, "fewer indices than it says"),
        ("a.off", "OFF\n3 1 0\n0 0\n1 0 0\n0 1 0\n3 0 1 2\n", MeshReadError, "fewer than 3 coordinates"),
        ("a.off", "OFF\n0 0 0\n", MeshError, "must hold vertices; got none"),
        ("a.off", "OFF", MeshReadError, "not a readable .off file"),
        ("a.obj", "# nothing\n", MeshError, "must hold vertices; got none"),
        ("a.obj", "v 0 0 0\n", MeshError, "must hold facets; got 1 vertices without"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", MeshReadError, "vertex index 0"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 -1 -2\n", MeshReadError, "before the first vertex"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", MeshReadError, "line 4: .*beyond the 3"),
        ("a.obj", "v 0 0 0\nf a b c\n", MeshReadError, "not a readable .obj file"),
        ("a.stl", "hello", MeshReadError, "neither a text file"),
        ("a.stl", "solid\nendsolid\n", MeshError, "must hold vertices; got none"),
        ("a.stl", "solid\nvertex 0 0 0\nendloop\n", MeshReadError, "line 2: here must be a facet"),
        ("a.wrl", "#VRML V2.0 utf8\n", MeshReadError, "not a readable .wrl file: File without a geometry"),
        ("a.wrl", "#VRML V2.0 utf8\nShape { geometry Ind", MeshReadError, "not a readable .wrl file"),
        ("a.glb", "glTF" + "\0" * 60, MeshReadError, "not a readable .glb file"),
    ],
)  # fmt: skip
def test_files_that_are_refused(tmp_path, capfd, name, content, kind, text):
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(kind, match=text) as info:
        as_mesh(path)
    assert type(info.value) is kind
    assert "\n" not in str(info.value)
    assert str(path) in str(info.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("cut", [3, 20, 200, 400, 410, 520])
@pytest.mark.parametrize("sides", [SIDES, SIDES[1:]])
def test_a_truncated_binary_ply_is_refused(tmp_path, cut, sides):
    path = tmp_path / "cut.ply"
    path.write_bytes(ply_binary("<", sides)[:-9][: cut if cut < 500 else None])
    with pytest.raises(MeshReadError, match=r"not a readable \.ply file"):
        as_mesh(path)


@pytest.mark.parametrize(
    ("suffix", "data"),
    [
        (".ply", ply_text()),
        (".ply", ply_binary("<")),
        (".ply", ply_binary(">", SIDES[1:])),
        (".off", OFF.encode()),
        (".obj", OBJ.encode()),
    ],
)
def test_damaged_files_give_a_mesh_or_one_line(tmp_path, rng, suffix, data):
    path = tmp_path / f"damaged{suffix}"
    words = [b"-1", b"99999999999999999999", b"nan", b"1e308", b"x", b"3", b" ", b"\n", b"list", b"\xff"]
    texts = []
    for _ in range(150):
        damaged = bytearray(data)
        for at in rng.integers(len(data), size=rng.integers(1, 4)):
            damaged[at : at + int(rng.integers(0, 8))] = words[rng.integers(len(words))]
        path.write_bytes(damaged)
        try:
            as_mesh(path).facts()
        except (MeshError, MeshReadError) as error:
            texts.append(str(error))
    assert texts
    assert not any("\n" in text for text in texts)


@pytest.mark.parametrize("suffix", [".ply", ".wrl", ".glb", ".stl"])
def test_missing_files_and_folders(tmp_path, suffix):
    with pytest.raises(MeshReadError, match=r"`path` must be an existing file; got '.*missing"):
        as_mesh(tmp_path / f"missing{suffix}")
    folder = tmp_path / f"folder{suffix}"
    folder.mkdir()
    with pytest.raises(MeshReadError, match="`path` must be a file; got the folder"):
        as_mesh(str(folder))


# ---------------------------------------------------------------- imports


def _run(code):
    root = Path(__file__).resolve().parents[2]
    return subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=False)


def test_no_heavy_import_at_import():
    code = (
        "import sys, voxkernel.mesh, voxkernel._open3d\n"
        "heavy = 'open3d pymeshlab meshio trimesh pyvista vtkmodules mapbox_earcut'.split()\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    done = _run(code)
    assert done.stdout.strip() == "[]", done.stderr


@pytest.mark.parametrize("first", ["open3d", "pymeshlab"])
def test_open3d_and_pymeshlab_live_in_one_process(tmp_path, first):
    path = tmp_path / "face.wrl"
    path.write_text(wrl_text())
    steps = [
        "from voxkernel._open3d import open3d; ball = open3d().geometry.TriangleMesh.create_sphere()",
        f"from voxkernel.mesh import as_mesh; face = as_mesh({str(path)!r})",
    ]
    steps = steps if first == "open3d" else steps[::-1]
    report = "print(as_mesh(ball).facts().is_closed, face.n_facets, len(face.to_open3d().triangles))"
    done = _run("\n".join([*steps, report]))
    assert done.stdout.split() == ["True", "4", "4"], done.stderr


def _package(path):
    return types.SimpleNamespace(get_library_path=lambda: path)


def test_libusb_comes_from_the_package_where_the_system_has_none(monkeypatch):
    asked = []

    def load(name, mode):
        asked.append(str(name))
        if name == "libusb-1.0.so.0":
            raise OSError("not here")

    monkeypatch.setattr(_open3d.ctypes, "CDLL", load)
    monkeypatch.setitem(sys.modules, "libusb_package", _package("/its/lib"))
    _open3d._preload_libusb()
    assert asked == ["libusb-1.0.so.0", "/its/lib"]
    monkeypatch.setitem(sys.modules, "libusb_package", _package(None))
    _open3d._preload_libusb()
    monkeypatch.setitem(sys.modules, "libusb_package", None)  # import fails
    _open3d._preload_libusb()
    assert asked[2:] == ["libusb-1.0.so.0", "libusb-1.0.so.0"]


def test_libusb_of_the_system_is_enough(monkeypatch):
    asked = []
    monkeypatch.setattr(_open3d.ctypes, "CDLL", lambda name, mode: asked.append(name))
    monkeypatch.setitem(sys.modules, "libusb_package", None)
    _open3d._preload_libusb()
    assert asked == ["libusb-1.0.so.0"]


def test_a_library_open3d_misses_is_named(monkeypatch):
    def fail(name):
        raise OSError("libusb-1.0.so.0: cannot open shared object file")

    monkeypatch.delitem(sys.modules, "open3d", raising=False)
    monkeypatch.setattr(_open3d, "optional", fail)
    monkeypatch.setattr(_open3d, "_preload_libusb", lambda: None)
    with pytest.raises(ImportError, match=r"open3d cannot be loaded: libusb.*pip install libusb-package"):
        _open3d.open3d()
