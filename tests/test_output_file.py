"""A file is there completely or not at all, and nothing lies beside it."""

import os

import pytest

from voxkernel._output_file import is_unfinished, whole_file


@pytest.mark.parametrize("durable", [False, True])
def test_the_old_file_stays_until_the_new_one_is_complete(tmp_path, monkeypatch, durable):
    synced = []
    monkeypatch.setattr(os, "fsync", lambda number: synced.append(os.fstat(number).st_size))
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")
    with whole_file(path, durable=durable) as file:
        file.write(b"new")
        assert path.read_bytes() == b"old"
        (beside,) = set(os.listdir(tmp_path)) - {"a.bin"}
        assert is_unfinished(beside)
    assert path.read_bytes() == b"new"
    assert os.listdir(tmp_path) == ["a.bin"]
    assert synced == ([3] if durable else [])


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, SystemExit])
def test_nothing_is_left_of_what_was_not_finished(tmp_path, error):
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")

    def stopped():
        with whole_file(path) as file:
            file.write(b"new")
            raise error

    with pytest.raises(error):
        stopped()
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.bin"]


def test_nothing_is_left_where_the_place_cannot_be_taken(tmp_path):
    (tmp_path / "folder").mkdir()
    with pytest.raises(OSError, match="folder"), whole_file(tmp_path / "folder"):
        pass
    assert os.listdir(tmp_path) == ["folder"]


def test_no_folder_is_the_error_of_the_system(tmp_path):
    with pytest.raises(FileNotFoundError, match="No such file"), whole_file(tmp_path / "no" / "a.bin"):
        pass


def test_names_of_unfinished_files():
    assert is_unfinished("." + "0123456789abcdef" * 2 + ".tmp")
    assert not is_unfinished(".mine.tmp")
    assert not is_unfinished("." + "0" * 32 + ".tmp.ply")
