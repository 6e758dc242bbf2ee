"""PyMeshLab in a child: whatever happens to it there is one line here. A module of its name does what the file says."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from voxkernel import as_mesh
from voxkernel.errors import MeshError, MeshReadError
from voxkernel.mesh import other_formats
from voxkernel.mesh.other_formats import MeshlabReader, read_with_meshlab

MODULE = """
import ctypes, os, resource, time
from pathlib import Path
import numpy as np

class Layer:
    def __init__(self, faces, first):
        self.points = np.array([[first, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        self.faces = np.array(faces)
    def vertex_matrix(self): return self.points
    def face_matrix(self): return self.faces
    def transform_matrix(self): return np.eye(4)

class MeshSet(list):
    def load_new_mesh(self, file):
        word, *rest = Path(file).read_text().split(maxsplit=1)
        faces, first = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], 0.0
        if word == "die": ctypes.string_at(0)
        if word == "leave": os._exit(3)
        if word == "spin":
            while True: pass
        if word == "sleep":
            if rest: Path(rest[0]).write_text(str(os.getpid()))
            time.sleep(1000)
        if word == "eat": bytearray(2**34)
        if word == "print": os.write(1, b"noise"), os.write(2, b"noise")
        if word == "raise": raise RuntimeError("first line\\nError details: one\\ntwo")
        if word == "index": faces[0] = [0, 2, 4]
        if word == "nan": first = np.nan
        if word == "core": assert resource.getrlimit(resource.RLIMIT_CORE)[0] == 0
        self.append(Layer(faces, first))
"""
needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="signals and limits as Unix has them")
needs_linux = pytest.mark.skipif(sys.platform != "linux", reason="a limit of addresses as Linux has it")


@pytest.fixture
def says(tmp_path, monkeypatch):
    """Make a file that says what happens."""
    (tmp_path / "pymeshlab.py").write_text(MODULE)
    monkeypatch.syspath_prepend(tmp_path)

    def make(word):
        path = tmp_path / "a.fbx"
        path.write_text(word)
        return path

    return make


@pytest.mark.parametrize(
    ("word", "match"),
    [
        pytest.param("die", "cannot be read: PyMeshLab died of SIGSEGV", marks=needs_posix),
        ("leave", "cannot be read: PyMeshLab ended with exit code 3"),
        pytest.param("spin", "cannot be read: PyMeshLab took more than 1 s of processor time", marks=needs_posix),
        pytest.param("eat", "is not a readable .fbx file: MemoryError", marks=needs_linux),
        ("raise", "is not a readable .fbx file: one two"),
    ],
)
def test_what_ends_the_child_is_a_line_that_names_the_file(says, word, match):
    with MeshlabReader(seconds=1) as reader:
        with pytest.raises(MeshReadError, match=match) as caught:
            reader.read(says(word))
        assert "a.fbx'" in str(caught.value)
        assert "\n" not in str(caught.value)
        vertices, faces = reader.read(says("accept"))  # the next file finds a child again
    assert vertices.shape == (4, 3)
    assert faces.tolist() == [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


@pytest.mark.parametrize("word", ["print", pytest.param("core", marks=needs_posix)])
def test_words_of_libraries_are_no_answer_and_no_core_is_left(says, word, capfd):
    assert as_mesh(says(word)).n_facets == 4
    assert capfd.readouterr() == ("", "")


def test_a_child_asleep_is_ended(says, monkeypatch):
    monkeypatch.setattr(other_formats, "_WALL_SECONDS", 0)
    monkeypatch.setattr(other_formats, "_WALL_FACTOR", 1)
    with MeshlabReader(seconds=3) as reader, pytest.raises(MeshReadError, match=r"took more than 3 s$"):
        reader.read(says("sleep"))


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="the system does not tell processor times")
def test_a_child_that_waits_for_ever_is_ended_long_before_its_time_is_over(says, monkeypatch):
    monkeypatch.setattr(other_formats, "_ASLEEP_SECONDS", 2)
    with MeshlabReader() as reader, pytest.raises(MeshReadError, match=r"PyMeshLab did nothing for 2 s$"):
        reader.read(says("sleep"))


def test_values_are_checked_by_the_caller(says):
    with pytest.raises(MeshError, match=r"a\.fbx'.*must be .*got 4"):
        as_mesh(says("index"))
    with pytest.raises(MeshError, match=r"a\.fbx'.*finite"):
        as_mesh(says("nan"))


@pytest.mark.parametrize(
    ("answer", "match"),
    [
        ("print('{}')", "gave no sensible answer"),
        ("print('no json')", "gave no sensible answer"),
        ("print('[3]')", "gave no sensible answer"),
        ('print(\'{"n_vertices": -1, "n_faces": 0}\')', "gave no sensible answer"),
        ('print(\'{"n_vertices": 4, "n_faces": 4}\')', "ended with exit code 0"),
        ('print(\'{"n_vertices": 1000000000000000, "n_faces": 4}\')', "too large for the memory"),
        ("print('x' * 100000)", "ended with exit code 0|died of SIG|PyMeshLab ended with exit code 120"),
    ],
)
def test_an_answer_that_is_none(tmp_path, monkeypatch, answer, match):
    program = tmp_path / "child.py"
    program.write_text(f"import sys\nsys.stdin.readline()\n{answer}\n")
    monkeypatch.setattr(other_formats, "_PROGRAM", program)
    path = tmp_path / "a.3ds"
    path.write_text("x")
    with pytest.raises(MeshReadError, match=match):
        read_with_meshlab(path)


def test_programs_without_an_interpreter_are_told(tmp_path, monkeypatch):
    path = tmp_path / "a.3ds"
    path.write_text("x")
    monkeypatch.setattr(sys, "executable", "")
    with pytest.raises(MeshReadError, match=r"a\.3ds' must be read .* got a program without one \(convert it to \.ply"):
        as_mesh(path)


def test_threads_read_at_once(says, tmp_path):
    path, found = says("accept"), []
    threads = [threading.Thread(target=lambda: found.append(as_mesh(path))) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [mesh.n_facets for mesh in found] == [4, 4, 4]


@needs_posix
def test_an_interrupt_of_the_parent_ends_the_child(says, tmp_path):
    noted = tmp_path / "number"
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\nfrom voxkernel import as_mesh\nas_mesh(sys.argv[1])"
    root = Path(__file__).resolve().parents[2]
    words = [sys.executable, "-c", code, str(says(f"sleep {noted}"))]
    parent = subprocess.Popen(words, cwd=root, stderr=subprocess.PIPE, text=True, start_new_session=True)
    child = _number_in(noted)
    os.kill(parent.pid, signal.SIGINT)
    assert "KeyboardInterrupt" in parent.communicate(timeout=300)[1]
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)


def _number_in(file):
    deadline = time.monotonic() + 300
    while not (file.exists() and file.read_text()):
        assert time.monotonic() < deadline, "the child never read the file"
        time.sleep(0.05)
    return int(file.read_text())


def test_parts_of_a_gltf_file_are_found_and_counted(tmp_path):
    (tmp_path / "part 1.bin").write_bytes(bytes(1000))
    path = tmp_path / "a.gltf"
    path.write_text('{"buffers": [{"uri": "part 1.bin"}, {"uri": "missing.bin"}, {"uri": "data:,x"}]}')
    assert other_formats._size_with_parts(path) == path.stat().st_size + 1000


def test_relative_paths(says, tmp_path, monkeypatch):
    says("accept")
    monkeypatch.chdir(tmp_path)
    assert np.array_equal(as_mesh("a.fbx").faces[0], [0, 2, 1])
