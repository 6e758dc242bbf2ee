"""Sources of streams: the same doubles as in memory, and every error with its chunk and facet."""

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.errors import MeshError, MeshReadError

STAR = shapes.star_prism()
COLUMNS = [f"{axis}{corner}" for corner in range(3) for axis in "xyz"]


def corners_of(source, size=5):
    surface = voxkernel.stream_mesh(source, chunk_facets=size)
    return np.concatenate([chunk.corners for _, chunk in surface._reader.chunks("test")])


def read(source, **options):
    """One pass."""
    return voxkernel.stream_mesh(source, **options).n_facets


def ply(path, vertices, faces, *, vertex="double x double y double z", order="<", extra=False):
    """A file whose rows may hold more than corners."""
    types = {"double": "f8", "float": "f4", "uchar": "u1"}
    names = [(w[1], order + types[w[0]]) for w in np.reshape(vertex.split(), (-1, 2)).tolist()]
    points = np.zeros(len(vertices), names)
    for k, axis in enumerate("xyz"):
        points[axis] = vertices[:, k]
    row = np.zeros(len(faces), [("n", "u1"), ("v", order + "i4", (3,))] + [("flags", order + "u2")] * extra)
    row["n"], row["v"] = 3, faces
    kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    lines = [f"property {t} {n}" for t, n in np.reshape(vertex.split(), (-1, 2)).tolist()]
    head = ["ply", f"format {kind} 1.0", f"element vertex {len(points)}", *lines, f"element face {len(faces)}"]
    head += ["property list uchar int vertex_indices", *["property ushort flags"] * extra, "end_header", ""]
    path.write_bytes("\n".join(head).encode() + points.tobytes() + row.tobytes())
    return path


def parquet(path, corners, **options):
    arrow = pytest.importorskip("pyarrow")
    table = arrow.table(dict(zip(COLUMNS, corners.reshape(-1, 9).T, strict=True)))
    pytest.importorskip("pyarrow.parquet").write_table(table, path, **options)
    return path


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"order": ">"},
        {"extra": True},
        {"vertex": "float x float y float z"},
        {"vertex": "uchar red double x double y double z"},
        {"vertex": "double z uchar red double x double y"},
        {"vertex": "float x double y double z"},
    ],
)
def test_ply_gives_the_doubles_of_memory(tmp_path, options):
    path = ply(tmp_path / "star.ply", *STAR, **options)
    mesh = voxkernel.as_mesh(path)
    np.testing.assert_array_equal(corners_of(path), mesh.vertices[mesh.faces])
    assert voxkernel.stream_mesh(path).bounds_volume


def test_stl_gives_the_doubles_of_memory_and_equal_corners_are_one(tmp_path):
    voxkernel.as_mesh(STAR).write(tmp_path / "star.stl")
    mesh = voxkernel.as_mesh(tmp_path / "star.stl")
    np.testing.assert_array_equal(corners_of(tmp_path / "star.stl"), mesh.vertices[mesh.faces])
    surface = voxkernel.stream_mesh(tmp_path / "star.stl", chunk_facets=5)
    assert surface.bounds_volume
    assert repr(surface) == f"StreamedSurface('{tmp_path / 'star.stl'}', 28 facets, chunk_facets=5)"
    assert voxkernel.exact_kernel(surface).volume == voxkernel.exact_kernel(mesh).volume


def test_parquet(tmp_path):
    corners = STAR[0][STAR[1]]
    path = parquet(tmp_path / "star.parquet", corners, row_group_size=9)
    np.testing.assert_array_equal(corners_of(path), corners)
    kernel = voxkernel.exact_kernel(voxkernel.stream_mesh(path, chunk_facets=5))
    assert kernel.volume == voxkernel.exact_kernel(STAR).volume


def test_tiles_meet_where_their_corners_are_equal(tmp_path):
    vertices, faces = STAR
    paths = []
    for k, part in enumerate(np.array_split(faces, 3)):
        paths.append(tmp_path / f"tile{k}.ply")
        voxkernel.TriangleMesh.from_triangles(vertices, part).write(paths[-1])
    for source in (tmp_path, paths, tuple(map(str, paths))):
        surface = voxkernel.stream_mesh(source, chunk_facets=4)
        assert surface.bounds_volume
        assert voxkernel.exact_kernel(surface).face_facets.tolist() == (
            voxkernel.exact_kernel(STAR).face_facets.tolist()
        )
    assert not voxkernel.stream_mesh(paths[:2]).bounds_volume
    assert voxkernel.stream_mesh(paths).source == "3 tiles"


def test_chunks_of_the_caller():
    vertices, faces = STAR
    pairs = [(vertices, faces[:10]), (vertices[::-1].copy(), len(vertices) - 1 - faces[10:])]
    whole = voxkernel.exact_kernel(STAR)
    for source in (pairs, lambda: iter(pairs)):
        surface = voxkernel.stream_mesh(source, chunk_facets=7)
        kernel = voxkernel.exact_kernel(surface)
        np.testing.assert_array_equal(kernel.vertices, whole.vertices)
        assert kernel.domain is None
        assert repr(surface) == "StreamedSurface(stream, chunk_facets=7)"


def test_closed_is_decided_by_edges_of_any_multiplicity():
    # Closed in memory is closed in a stream, and the other way round: by numbers, and by positions.
    for name in ("cubes_sharing_an_edge", "three_faces_on_an_edge", "moebius_band", "cube_with_flipped_face", "cube"):
        mesh = getattr(shapes, name)()
        closed = voxkernel.HalfSpaces.from_mesh(voxkernel.as_mesh(mesh)).bounds_volume
        assert voxkernel.stream_mesh(mesh, chunk_facets=1).bounds_volume == closed
        assert voxkernel.stream_mesh([mesh]).bounds_volume == closed
    vertices, faces = shapes.tetrahedron()
    flat = vertices * [1, 1, 0]
    assert not voxkernel.stream_mesh((flat, faces), chunk_facets=1).bounds_volume  # it encloses nothing


def test_zeros_of_both_signs_are_one_corner():
    vertices, faces = shapes.tetrahedron()
    pairs = [(vertices, faces[:2]), (np.where(vertices == 0, -0.0, vertices), faces[2:])]
    assert voxkernel.stream_mesh(pairs).bounds_volume


def test_what_is_read_only_once_is_refused():
    with pytest.raises(ValueError, match=r"`source` must be readable again.*; got a generator that can be read once"):
        voxkernel.stream_mesh(pair for pair in [STAR])
    ended = iter([STAR])
    with pytest.raises(MeshError, match="`source` must give the same facets in every pass; got 0 after 28"):
        voxkernel.exact_kernel(voxkernel.stream_mesh(lambda: ended))


def test_bad_facets_name_chunk_and_facet(tmp_path):
    vertices, faces = STAR
    beyond = faces.copy()
    beyond[23, 1] = 99
    hole = vertices.copy()
    hole[faces[13, 2]] = np.nan
    first = int(np.argmax((faces == faces[13, 2]).any(axis=1)))
    for source in ((vertices, beyond), ply(tmp_path / "beyond.ply", vertices, beyond)):
        with pytest.raises(MeshError, match=r"chunk 4, facet 23: `faces` must hold vertex ids from 0 to 15; got 99"):
            corners_of(source)
    for source in ((hole, faces), ply(tmp_path / "hole.ply", hole, faces)):
        with pytest.raises(MeshError, match=rf"chunk {first // 5}, facet {first}: `vertices` must be finite; got NaN"):
            read(source, chunk_facets=5)
    with pytest.raises(MeshError, match=r"stream, chunk 1, facet 51: `faces` must hold vertex ids from 0 to 15"):
        corners_of([STAR, (vertices, beyond)])
    with pytest.raises(MeshError, match=rf"stream, chunk 1, facet {28 + first}: `vertices` must be finite"):
        corners_of([STAR, (hole, faces)], 1000)
    soup = vertices[faces]
    soup[17, 0, 0] = np.inf
    with pytest.raises(MeshError, match=r"chunk 3, facet 17: `vertices` must be finite"):
        read(parquet(tmp_path / "hole.parquet", soup), chunk_facets=5)


@pytest.mark.parametrize("threads", [1, 3])
def test_a_late_error_names_its_chunk(tmp_path, threads):
    vertices, faces = shapes.spiky(3)
    hole, late = np.concatenate([vertices, [[0, np.nan, 0]]]), faces.copy()
    late[1000, 1] = len(vertices)
    surface = voxkernel.stream_mesh(ply(tmp_path / "nan.ply", hole, late), chunk_facets=1)
    with pytest.raises(MeshError, match=r"nan.ply', chunk 1000, facet 1000: `vertices` must be finite; got NaN"):
        voxkernel.exact_kernel(surface, threads=threads)
    late[1000, 1], late[-1, 1] = 0, len(hole)
    surface = voxkernel.stream_mesh(ply(tmp_path / "last.ply", vertices, late), chunk_facets=7)
    with pytest.raises(MeshError, match=r"last.ply', chunk 182, facet 1279: `faces` must hold vertex ids from"):
        voxkernel.exact_kernel(surface, threads=threads)


def test_files_that_end_too_early(tmp_path):
    path = ply(tmp_path / "star.ply", *STAR)
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(MeshReadError, match=r"chunk 5, facet 25: the file ends before its 28 facets do"):
        corners_of(path)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(MeshReadError, match="it ends before its vertices and faces do"):
        corners_of(path)
    path = ply(tmp_path / "long.ply", *STAR)
    path.write_bytes(path.read_bytes() + b"more")
    with pytest.raises(MeshReadError, match="it has 4 bytes more than 28 triangles take"):
        corners_of(path)
    voxkernel.as_mesh(STAR).write(tmp_path / "star.stl")
    data = (tmp_path / "star.stl").read_bytes()
    for cut, text in ((-1, "chunk 5, facet 27: the file ends before its 28 facets do"), (40, "within its first 84")):
        (tmp_path / "star.stl").write_bytes(data[:cut])
        with pytest.raises(MeshReadError, match=text):
            corners_of(tmp_path / "star.stl")
    (tmp_path / "star.stl").write_bytes(data + b"!")
    with pytest.raises(MeshReadError, match="it has 1 bytes more than 28 facets take"):
        corners_of(tmp_path / "star.stl")


def test_a_face_of_two_corners_is_refused(tmp_path):
    rows = np.frombuffer(ply(tmp_path / "star.ply", *STAR).read_bytes(), np.uint8).copy()
    rows[len(rows) - 13 * 4] = 2
    rows.tofile(tmp_path / "star.ply")
    with pytest.raises(MeshError, match=r"chunk 4, facet 24: must be a triangle to be streamed; got 2 corners"):
        corners_of(tmp_path / "star.ply")


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("ply\nformat binary_little_endian 1.0\nend_header\n", "it has no vertices or no faces"),
        ("no ply", "it does not start with 'ply'"),
        (
            "ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nproperty float y\n"
            "property float z\nelement face 0\nproperty list int float vertex_index\nend_header\n",
            "faces have no list of vertex ids",
        ),
    ],
)
def test_other_ply_files_are_refused(tmp_path, text, match):
    (tmp_path / "a.ply").write_text(text)
    with pytest.raises(MeshReadError, match=match):
        voxkernel.stream_mesh(tmp_path / "a.ply")


def test_other_sources_are_refused(tmp_path):
    with pytest.raises(TypeError, match=r"`source` must be a path, several paths, .*; got int"):
        voxkernel.stream_mesh(3)
    with pytest.raises(ValueError, match=r"`chunk_facets` must be in 1\.\.16777216; got 0"):
        voxkernel.stream_mesh(STAR, chunk_facets=0)
    with pytest.raises(MeshReadError, match=r"a.wrl' cannot be streamed: it must end in .glb .gltf .obj .off .par"):
        voxkernel.stream_mesh(tmp_path / "a.wrl")
    with pytest.raises(MeshReadError, match=r"must hold .glb or .gltf or .obj or .* or .stl or .zarr files"):
        voxkernel.stream_mesh(tmp_path)
    with pytest.raises(MeshReadError, match="`path` must be an existing file"):
        voxkernel.stream_mesh(tmp_path / "a.ply")
    with pytest.raises(ValueError, match="`edges` must be one of 'hashed', 'sorted'; got 'guessed'"):
        voxkernel.stream_mesh(STAR, edges="guessed")
    with pytest.raises(ValueError, match="`temporary_folder` must be an existing folder; got 'nowhere'"):
        voxkernel.stream_mesh(STAR, temporary_folder="nowhere")
    (tmp_path / "a.parquet").write_text("no parquet")
    pytest.importorskip("pyarrow")
    with pytest.raises(MeshReadError, match="cannot be streamed"):
        voxkernel.stream_mesh(tmp_path / "a.parquet")


def test_arrays_and_chunks_of_other_shapes_are_refused():
    with pytest.raises(MeshError, match=r"`vertices` must have shape \(n, 3\); got \(4, 2\)"):
        voxkernel.stream_mesh((np.zeros((4, 2)), [[0, 1, 2]]))
    with pytest.raises(MeshError, match=r"`faces` must have shape \(m, 3\); got \(1, 4\) \(triangulate first\)"):
        voxkernel.stream_mesh((np.zeros((4, 3)), [[0, 1, 2, 3]]))
    with pytest.raises(TypeError, match="`faces` must be integers; got float64"):
        voxkernel.stream_mesh((np.zeros((4, 3)), [[0.0, 1, 2]]))
    for pair, match in (
        (3, r"chunk 1: must be a pair \(vertices, faces\); got int"),
        ((np.zeros((4, 2)), [[0, 1, 2]]), r"chunk 1: `vertices` must have shape \(n, 3\); got \(4, 2\)"),
        ((np.zeros((4, 3)), [[0.5, 1, 2]]), r"chunk 1: `faces` must be integers of shape \(m, 3\); got float64"),
    ):
        with pytest.raises(MeshError, match=match):
            corners_of(lambda pair=pair: [STAR, pair])
    with pytest.raises(MeshError, match="stream must hold facets; got none"):
        read(list)
    with pytest.raises(MeshError, match="must have a facet with positive area; got 1 facets without area"):
        read((np.eye(3), [[0, 1, 1]]))


def test_progress_counts_facets():
    states = []
    read(STAR, chunk_facets=10, progress=states.append)
    assert [(s.stage, s.done, s.total) for s in states] == [("frame", 10, 28), ("frame", 20, 28), ("frame", 28, 28)]
    assert str(states[1]).startswith("frame: 20 of 28 facets, ")


def test_an_interrupt_ends_a_pass():
    def stop(state):
        if state.done > 10:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        voxkernel.exact_kernel(voxkernel.stream_mesh(STAR, chunk_facets=10, progress=stop))
