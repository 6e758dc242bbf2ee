"""Text files, polygons, glTF and Zarr in streams; edges sorted in files; what is wrong is named."""

import base64
import json
import struct

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.errors import MeshError, MeshReadError
from voxkernel.large.sorted_edges import edges_cancel
from voxkernel.mesh import usual_files

STAR = shapes.star_prism()
QUADS = shapes.prism_polygons([(0, 0), (2, 0), (2, 1), (1, 0.5), (0, 1)])


def corners_of(path, size=5, **options):
    surface = voxkernel.stream_mesh(path, chunk_facets=size, **options)
    return np.concatenate([chunk.corners for _, chunk in surface._reader.chunks("test")])


def ply_head(kind, vertices, polygons):
    xyz = "property double x\nproperty double y\nproperty double z\n"
    faces = f"element face {len(polygons)}\nproperty list uchar int vertex_indices\nend_header\n"
    return f"ply\nformat {kind} 1.0\nelement vertex {len(vertices)}\n{xyz}{faces}"


def text_ply(path, vertices, polygons):
    faces = "".join(f"{len(p)} {' '.join(map(str, p))}\n" for p in polygons)
    path.write_text(ply_head("ascii", vertices, polygons) + rows(vertices) + faces)


def binary_ply(path, vertices, polygons):
    body = b"".join(struct.pack(f"<B{len(p)}i", len(p), *p) for p in polygons)
    head = ply_head("binary_little_endian", vertices, polygons).encode()
    path.write_bytes(head + np.asarray(vertices, float).tobytes() + body)


def off(path, vertices, polygons):
    faces = "".join(f"{len(p)} {' '.join(map(str, p))}\n" for p in polygons)
    path.write_text(f"OFF\n{len(vertices)} {len(polygons)} 0\n" + rows(vertices) + faces)


def obj(path, vertices, polygons):
    """Every other face counts its vertices from the end, and comes as soon as they are there."""
    lines, at = [], 0
    for k, polygon in enumerate(polygons):
        while at <= max(polygon):
            lines.append("v " + " ".join(map(repr, map(float, vertices[at]))))
            at += 1
        lines.append("f " + " ".join(str(i - at if k % 2 else i + 1) for i in polygon))
    path.write_text("\n".join(lines) + "\n")


def text_stl(path, vertices, faces):
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex " + " ".join(map(repr, map(float, corner))) + "\n" for corner in vertices[list(face)])
        + "endloop\nendfacet\n"
        for face in faces
    )
    path.write_text(f"solid a b\n{facets}endsolid a b\n")


def rows(vertices):
    return "".join(" ".join(map(repr, map(float, v))) + "\n" for v in vertices)


WRITERS = {"text.ply": text_ply, "mixed.ply": binary_ply, "a.off": off, "a.obj": obj}


@pytest.mark.parametrize("stretch", [64, 1 << 22])
@pytest.mark.parametrize("name", [*WRITERS, "text.stl"])
def test_triangles_are_those_of_memory(tmp_path, monkeypatch, name, stretch):
    monkeypatch.setattr(usual_files, "_STRETCH", stretch)
    vertices, faces = np.asarray(STAR[0]) / 3, STAR[1]
    {**WRITERS, "text.stl": text_stl}[name](tmp_path / name, vertices, faces.tolist())
    np.testing.assert_array_equal(corners_of(tmp_path / name), vertices[faces])
    surface = voxkernel.stream_mesh(tmp_path / name, chunk_facets=9)
    assert surface.bounds_volume
    whole = voxkernel.exact_kernel(tmp_path / name)
    np.testing.assert_array_equal(voxkernel.exact_kernel(surface, threads=2).vertices, whole.vertices)


@pytest.mark.parametrize("name", WRITERS)
def test_polygons_are_cut_as_in_memory(tmp_path, name):
    vertices, polygons = QUADS
    polygons = [*map(list, polygons[-3:]), *map(list, polygons[:-3])]
    WRITERS[name](tmp_path / name, vertices, polygons)
    mesh = voxkernel.as_mesh(tmp_path / name)
    np.testing.assert_array_equal(corners_of(tmp_path / name), mesh.vertices[mesh.faces])
    assert voxkernel.stream_mesh(tmp_path / name).n_facets == len(mesh.faces)
    kernel = voxkernel.exact_kernel(voxkernel.stream_mesh(tmp_path / name, chunk_facets=3))
    assert kernel.volume == pytest.approx(voxkernel.exact_kernel(mesh).volume, rel=1e-12)


def test_polygons_behind_triangles_are_found(tmp_path):
    vertices, polygons = QUADS
    triangle_first = [list(polygons[0][:3]), *map(list, polygons)]
    binary_ply(tmp_path / "a.ply", vertices, triangle_first)
    mesh = voxkernel.as_mesh(tmp_path / "a.ply")
    np.testing.assert_array_equal(corners_of(tmp_path / "a.ply"), mesh.vertices[mesh.faces])


def test_what_is_unusual_is_read_in_memory(tmp_path):
    text = "OFF # a comment\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
    (tmp_path / "a.off").write_text(text)
    assert corners_of(tmp_path / "a.off").shape == (4, 3, 3)
    (tmp_path / "a.off").write_text(text.replace("0 1 0", "0 one 0"))
    with pytest.raises(MeshReadError, match=r"a.off' is not a readable .off file: .*line 5"):
        corners_of(tmp_path / "a.off")


def test_tiles_of_text_and_binary(tmp_path):
    vertices, faces = STAR
    parts = np.array_split(faces, 3)
    text_stl(tmp_path / "0.stl", vertices, parts[0].tolist())
    obj(tmp_path / "1.obj", vertices, parts[1].tolist())
    binary_ply(tmp_path / "2.ply", vertices, parts[2].tolist())
    surface = voxkernel.stream_mesh(tmp_path, chunk_facets=4)
    np.testing.assert_array_equal(corners_of(tmp_path, 4), vertices[faces])
    assert surface.bounds_volume
    assert voxkernel.exact_kernel(surface).volume == voxkernel.exact_kernel(STAR).volume


def test_errors_name_chunk_and_facet(tmp_path):
    vertices, faces = np.array(STAR[0], float), STAR[1].tolist()
    wrong = [*faces[:-1], [0, 1, 99]]
    obj_of = tmp_path / "a.ply"
    text_ply(obj_of, vertices, wrong)
    with pytest.raises(MeshError, match=r"a.ply', chunk 5, facet 27: `faces` must hold vertex ids .* got 99"):
        corners_of(obj_of)
    hole = np.concatenate([vertices, [[np.nan, 0, 0]]])
    text_ply(obj_of, hole, [*faces, [0, 1, 16]])
    with pytest.raises(MeshError, match=r"a.ply', chunk 4, facet 28: `vertices` must be finite; got NaN"):
        voxkernel.exact_kernel(voxkernel.stream_mesh(obj_of, chunk_facets=7))
    text_ply(obj_of, vertices, [*faces, [0, 1, 2, 99]])
    with pytest.raises(MeshError, match=r"a.ply', polygon 28: `polygons` must hold vertex ids from 0 to 15; got 99"):
        corners_of(obj_of)
    text_ply(obj_of, hole, [*faces, [0, 1, 2, 16]])
    with pytest.raises(MeshError, match=r"a.ply', polygon 28: `vertices` must be finite; got NaN"):
        corners_of(obj_of)
    text_ply(obj_of, vertices, [*faces, [0, 1]])
    with pytest.raises(MeshError, match=r"a.ply': `polygons` must have at least 3 corners each; got 2 in polygon 28"):
        corners_of(obj_of)
    (tmp_path / "a.obj").write_text("v 0 0 0\n")
    with pytest.raises(MeshError, match="must hold facets; got none"):
        corners_of(tmp_path / "a.obj")


def test_temporary_files_have_no_names(tmp_path):
    text_ply(tmp_path / "a.ply", *QUADS)
    (tmp_path / "temporary").mkdir()
    surface = voxkernel.stream_mesh(tmp_path / "a.ply", temporary_folder=tmp_path / "temporary", edges="sorted")
    assert surface.bounds_volume
    assert not list((tmp_path / "temporary").iterdir())


# ---------------------------------------------------------------- edges


@pytest.mark.parametrize("chunk", [1, 7, 1000])
def test_sorted_edges_say_what_hashed_ones_say(chunk):
    names = ("cubes_sharing_an_edge", "three_faces_on_an_edge", "moebius_band", "cube_with_flipped_face", "cube")
    for mesh in (*(getattr(shapes, name)() for name in names), shapes.open_box()):
        for source in (mesh, [mesh]):
            hashed = voxkernel.stream_mesh(source, chunk_facets=chunk)
            exact = voxkernel.stream_mesh(source, chunk_facets=chunk, edges="sorted")
            assert exact.bounds_volume == hashed.bounds_volume
    vertices, faces = shapes.tetrahedron()
    assert not voxkernel.stream_mesh((vertices * [1, 1, 0], faces), edges="sorted").bounds_volume  # it encloses nothing


def test_sorted_edges_of_the_same_hash_are_told_apart(monkeypatch):
    monkeypatch.setattr("voxkernel.large.sorted_edges.position_keys", lambda words: words[..., 0] * np.uint64(0))
    for mesh, closed in ((STAR, True), (shapes.open_box(), False)):
        reader = voxkernel.stream_mesh([mesh], chunk_facets=7)._reader
        assert edges_cancel(lambda reader=reader: (chunk for _, chunk in reader.chunks("test")), None) == closed


# ---------------------------------------------------------------- Zarr and glTF


def test_zarr(tmp_path):
    zarr = pytest.importorskip("zarr")
    corners = np.asarray(STAR[0])[STAR[1]]
    for name, array in (("a.zarr", corners.reshape(-1, 9)), ("b.zarr", corners)):
        made = zarr.create_array(tmp_path / name, shape=array.shape, chunks=(9, *array.shape[1:]), dtype=float)
        made[:] = array
        np.testing.assert_array_equal(corners_of(tmp_path / name), corners)
        surface = voxkernel.stream_mesh(tmp_path / name, chunk_facets=5)
        assert voxkernel.exact_kernel(surface, threads=2).volume == voxkernel.exact_kernel(STAR).volume
    made = zarr.create_array(tmp_path / "c.zarr", shape=(3, 4), dtype=float)
    with pytest.raises(MeshReadError, match=r"must hold facets as an array \(n, 9\) or \(n, 3, 3\) .* got \(3, 4"):
        voxkernel.stream_mesh(tmp_path / "c.zarr")
    with pytest.raises(MeshReadError, match="`path` must be an existing file"):
        voxkernel.stream_mesh(tmp_path / "d.zarr")
    (tmp_path / "e.zarr").mkdir()
    with pytest.raises(MeshReadError, match=r"e.zarr' cannot be streamed"):
        voxkernel.stream_mesh(tmp_path / "e.zarr")
    made = zarr.open_array(tmp_path / "b.zarr")
    made[17, 0, 0] = np.nan
    with pytest.raises(MeshError, match=r"b.zarr', chunk 3, facet 17: `vertices` must be finite"):
        voxkernel.exact_kernel(voxkernel.stream_mesh(tmp_path / "b.zarr", chunk_facets=5))


def test_glb_as_written(tmp_path):
    mesh = voxkernel.as_mesh(STAR)
    mesh.write(tmp_path / "star.glb")
    np.testing.assert_array_equal(corners_of(tmp_path / "star.glb"), mesh.vertices.astype("f4")[mesh.faces])
    surface = voxkernel.stream_mesh(tmp_path / "star.glb", chunk_facets=5)
    assert surface.source == f"'{tmp_path / 'star.glb'}'"
    assert surface.bounds_volume
    data = (tmp_path / "star.glb").read_bytes()
    (tmp_path / "star.glb").write_bytes(data[:-40])
    with pytest.raises(MeshReadError, match=r"star.glb' cannot be streamed: it ends 40 bytes before its chunks do"):
        voxkernel.stream_mesh(tmp_path / "star.glb")


def gltf(path, **changes):
    """Two cubes: one in a file beside it, moved by two nodes; its mirror image within the text, without indices."""
    vertices, faces = shapes.cube()
    first = vertices.astype("<f4").tobytes() + faces.astype("<u2").tobytes()
    (path.parent / "a b.bin").write_bytes(first)
    second = vertices.astype("<f4")[faces].tobytes()
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 2]}],
        "nodes": [
            {"children": [1], "translation": [5, 0, 0]},
            {"mesh": 0, "rotation": [0, 0, np.sqrt(0.5), np.sqrt(0.5)], "scale": [2, 1, 1]},
            {"mesh": 1, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, -3, 0, 0, 1]},
        ],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}, {"attributes": {"POSITION": 0}, "mode": 1}]},
            {"primitives": [{"attributes": {"POSITION": 2}}]},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 8},
            {"bufferView": 0, "byteOffset": 96, "componentType": 5123, "type": "SCALAR", "count": 36},
            {"bufferView": 1, "componentType": 5126, "type": "VEC3", "count": 36},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": len(first)}, {"buffer": 1, "byteLength": len(second)}],
        "buffers": [
            {"uri": "a%20b.bin", "byteLength": len(first)},
            {"uri": "data:;base64," + base64.b64encode(second).decode(), "byteLength": len(second)},
        ],
    }  # fmt: skip
    path.write_text(json.dumps(document | changes))
    return vertices, faces


def test_gltf_places_its_meshes(tmp_path):
    vertices, faces = gltf(tmp_path / "a.gltf")
    found = corners_of(tmp_path / "a.gltf")
    turned = np.stack([-vertices[:, 1] + 5, 2 * vertices[:, 0], vertices[:, 2]], axis=1)
    np.testing.assert_allclose(found[:12], turned[faces], atol=1e-15)
    mirrored = vertices * [-1, 1, 1] + [-3, 0, 0]
    np.testing.assert_array_equal(found[12:], mirrored[faces[:, ::-1]])
    surface = voxkernel.stream_mesh(tmp_path / "a.gltf", chunk_facets=5)
    assert surface.bounds_volume
    assert voxkernel.exact_kernel(surface).is_empty


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "it needs the extension KHR_draco_mesh_compression"),
        ({"buffers": [{"uri": "c.bin"}, {}]}, r"its buffer '.*c.bin' does not exist"),
        ({"buffers": [{}, {}]}, "buffer 0 is nowhere"),
        ({"buffers": [{"uri": "data:,AAAA"}, {}]}, "buffer 0 ends 165 bytes too early"),
        ({"buffers": [{"uri": "data:,A!"}, {}]}, "buffer 0 is no base64"),
        ({"bufferViews": [{"buffer": 0, "byteLength": 90}]}, "accessor 0 is larger than its buffer view"),
        ({"accessors": [{"count": 3}]}, "accessor 0 is sparse"),
        ({"accessors": [{"bufferView": 0, "componentType": 5123, "type": "VEC3"}]}, "accessor 0 has the type 5123"),
        ({"nodes": [{"children": [0]}]}, "its nodes form a circle"),
        ({"nodes": [{}], "scenes": [{"nodes": [0]}]}, "it has no triangles"),
        ({"meshes": [{"primitives": [{"mode": 5}]}]}, r"mesh 0 has triangles in strips or fans \(mode 5\)"),
        ({"meshes": []}, "IndexError"),
    ],
)
def test_gltf_that_cannot_be_streamed(tmp_path, changes, match):
    gltf(tmp_path / "a.gltf", **changes)
    with pytest.raises(MeshReadError, match="a.gltf' cannot be streamed: " + match):
        voxkernel.stream_mesh(tmp_path / "a.gltf")


def test_gltf_that_is_none(tmp_path):
    for text in ("", "no json", "[]"):
        (tmp_path / "a.gltf").write_text(text)
        with pytest.raises(MeshReadError, match=r"a.gltf' cannot be streamed"):
            voxkernel.stream_mesh(tmp_path / "a.gltf")


def test_ids_beyond_the_vertices_of_gltf(tmp_path):
    accessors = [
        {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 7},
        {"bufferView": 0, "byteOffset": 96, "componentType": 5123, "type": "SCALAR", "count": 36},
    ]
    _, faces = gltf(tmp_path / "a.gltf", accessors=accessors, scenes=[{"nodes": [0]}])
    first = int(np.argmax((faces == 7).any(axis=1)))
    text = rf"a.gltf', mesh 0, primitive 0, chunk {first // 5}, facet {first}: `faces` must hold vertex ids from 0 to 6"
    with pytest.raises(MeshError, match=text):
        corners_of(tmp_path / "a.gltf")
