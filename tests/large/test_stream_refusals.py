"""Streams that lie, break or change: one line, with file, chunk and facet where there are some."""

import os
import re
import threading

import numpy as np
import pytest
import shapes

import voxkernel
from voxkernel.errors import MeshError, MeshReadError

MESH = voxkernel.as_mesh(shapes.spiky(2))
V, F = np.array(MESH.vertices), np.array(MESH.faces)


def kernel(source):
    return voxkernel.exact_kernel(voxkernel.stream_mesh(source, chunk_facets=50))


def refused(error, text, make):
    with pytest.raises(error, match=re.escape(text)) as found:
        make()
    assert "\n" not in str(found.value)


@pytest.mark.parametrize("kind", [object, str, complex, bool, "M8[s]"])
def test_vertices_that_are_no_real_numbers(kind):
    other = V.astype(int).astype(kind) if kind == "M8[s]" else V.astype(kind)
    refused(MeshError, f"stream, chunk 1: `vertices` must be real numbers; got dtype {other.dtype}",
            lambda: kernel([(V, F), (other, F)]))  # fmt: skip
    refused(TypeError, f"`vertices` must be an array of real numbers; got dtype {other.dtype}",
            lambda: kernel((other, F)))  # fmt: skip


def test_chunks_of_several_kinds_of_numbers():
    whole = np.round(V * 64)
    parts = [(whole.astype(kind), F[k::3]) for k, kind in enumerate(("f4", "f8", "i8"))]
    faces = np.concatenate([F[k::3] for k in range(3)])
    assert kernel(parts).volume == kernel((whole, faces)).volume


def test_rows_of_different_lengths():
    refused(MeshError, "stream, chunk 1: `vertices` must be an array; got rows of different lengths",
            lambda: kernel([(V, F), ([[1, 2], [3]], F)]))  # fmt: skip
    refused(MeshError, "stream, chunk 1: `faces` must be an array; got rows", lambda: kernel([(V, F), (V, [[1], []])]))
    refused(MeshError, "`vertices` must be an array; got rows", lambda: kernel(([[1, 2], [3]], F)))


def test_ids_beyond_what_is_signed():
    huge = F.astype("u8") + np.uint64(2**63)
    text = f"`faces` must hold vertex ids from 0 to {len(V) - 1}; got {2**63 + int(F[0, 0])}"
    refused(MeshError, f"chunk 1, facet {len(F)}: {text}", lambda: kernel([(V, F), (V, huge)]))
    refused(MeshError, text, lambda: kernel((V, huge)))


@pytest.mark.parametrize("given", [None, 5])
def test_a_function_that_returns_no_pairs(given):
    text = f"the function must return pairs (vertices, faces), one after the other; got {type(given).__name__}"
    refused(MeshError, text, lambda: kernel(lambda: given))


def test_a_function_that_gives_another_surface_later():
    calls = []

    def other():
        calls.append(1)
        return [(V * len(calls), F)]

    refused(MeshError, "must give the same facets in every pass; got others than in the first", lambda: kernel(other))


def shrink(path):
    path.write_bytes(path.read_bytes()[:-500])


def grow(path):
    path.write_bytes(path.read_bytes() + bytes(500))


def rewrite(path):
    voxkernel.as_mesh((2 * V, F)).write(path)
    os.utime(path, ns=(1, 1))


def empty(path):
    path.write_bytes(b"")


TEXTS = {
    shrink: "the file must not change while it is streamed; it had",
    grow: "the file must not change while it is streamed; it had",
    rewrite: "the file must not change while it is streamed; it was written again",
    empty: "the file must not change while it is streamed; it had",
    os.unlink: "cannot be read any more: No such file",
}


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".glb"])
@pytest.mark.parametrize("change", TEXTS)
def test_files_that_change_between_passes(tmp_path, suffix, change):
    path = tmp_path / f"a{suffix}"
    for is_read in (False, True):
        MESH.write(path)
        surface = voxkernel.stream_mesh(path, chunk_facets=50)
        if is_read:
            assert surface.n_facets == len(F)
        change(path)
        refused(MeshReadError, TEXTS[change], lambda found=surface: voxkernel.exact_kernel(found))
        refused(MeshReadError, f"a{suffix}'", lambda found=surface: voxkernel.exact_kernel(found))


def test_a_file_that_shrinks_within_a_pass_names_its_chunk(tmp_path):
    path = tmp_path / "a.ply"
    MESH.write(path)
    chunks = voxkernel.stream_mesh(path, chunk_facets=50)._reader.chunks("test")
    next(chunks)
    shrink(path)
    refused(MeshReadError, "a.ply', chunk 1, facet 50: the file must not change", lambda: next(chunks))


def test_a_file_that_is_written_within_a_pass(tmp_path):
    path = tmp_path / "a.stl"
    MESH.write(path)
    chunks = voxkernel.stream_mesh(path, chunk_facets=50)._reader.chunks("test")
    next(chunks)
    rewrite(path)
    refused(MeshReadError, "a.stl': the file must not change while it is streamed", lambda: list(chunks))


def test_parquet_of_other_columns(tmp_path):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "a.parquet"
    columns = dict(zip([f"{axis}{k}" for k in range(3) for axis in "xyz"], V[F].reshape(-1, 9).T, strict=True))

    def written(**other):
        parquet.write_table(arrow.table({**columns, **other}), path)
        return voxkernel.stream_mesh(path, chunk_facets=50)

    for values, name in ((["1"] * len(F), "string"), ([True] * len(F), "bool"), ([[1.0]] * len(F), "list")):
        refused(MeshReadError, f"must have numbers in the column y1; got {name}", lambda v=values: written(y1=v))
    assert voxkernel.exact_kernel(written()).volume == kernel((V, F)).volume
    surface = written()
    path.write_bytes(b"xx")
    refused(MeshReadError, "a.parquet': the file must not change", lambda: voxkernel.exact_kernel(surface))
    data = bytearray((written(), path.read_bytes())[1])
    data[4:400] = bytes(396)  # the footer is as it was
    path.write_bytes(data)
    refused(MeshReadError, "a.parquet' cannot be read: ", lambda: kernel(path))


@pytest.mark.parametrize(
    ("content", "text"), [(b"hello", "1.ply' cannot be streamed: it does not start with 'ply'"), (None, "the folder")]
)
def test_a_tile_that_is_no_mesh(tmp_path, content, text):
    MESH.write(tmp_path / "0.ply")
    if content is None:
        (tmp_path / "1.ply").mkdir()
    else:
        (tmp_path / "1.ply").write_bytes(content)
    refused(MeshReadError, text, lambda: kernel(tmp_path))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with names")
def test_a_pipe_is_refused_before_it_is_opened(tmp_path):
    MESH.write(tmp_path / "0.ply")
    os.mkfifo(tmp_path / "1.ply")
    done = []

    def run():
        refused(MeshReadError, "must be a regular file; got the pipe", lambda: kernel(tmp_path))
        done.append(True)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(60)
    assert done
