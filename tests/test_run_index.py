"""Which rows of a run's parts count: the same as by a plain dictionary, and read whatever happens to the parts."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from voxkernel import run_table
from voxkernel.run_index import open_index


def random_rows(rng, n):
    """Files computed again and again, with other content, and cells that come and go."""
    for _ in range(n):
        file, version = f"{'äz/'[rng.integers(3)]}{rng.integers(6)}", int(rng.integers(3))
        cell = None if rng.random() < 0.5 else int(rng.integers(3))
        yield {
            "file": file, "cell": cell, "object": None if rng.random() < 0.8 else 0, "status": "ok",
            "ratio": float(rng.random()), "content_hash": f"c{version}" if version else None,
            "settings_hash": "s", "finished": f"{rng.integers(2)}",
        }  # fmt: skip


def by_dictionary(rows):
    """The slow twin: the last row of a file names its version, and the last of a key counts."""
    version = lambda row: (row["content_hash"], row["settings_hash"], row["finished"])  # noqa: E731
    current = {row["file"]: version(row) for row in rows}
    latest = {
        (row["file"], -1 if row["cell"] is None else row["cell"], -1 if row["object"] is None else row["object"]): row
        for row in rows if version(row) == current[row["file"]]
    }  # fmt: skip
    return [latest[key] for key in sorted(latest)]


@pytest.mark.parametrize("seed", range(12))
def test_rows_that_count(tmp_path, seed):
    rng = np.random.default_rng(seed)
    fs, path = run_table.open_run(str(tmp_path))
    rows = list(random_rows(rng, int(rng.integers(0, 80))))
    ends = np.sort(rng.integers(0, len(rows) + 1, 4))
    for begin, end in zip([0, *ends], [*ends, len(rows)], strict=True):
        if end > begin:
            run_table.write_part(fs, path, rows[begin:end])
    expected = run_table.to_table(by_dictionary(rows))
    assert run_table.read_rows(str(tmp_path)).equals(expected)
    index = open_index(fs, path, ["ratio"])
    assert len(index) == len(expected)
    assert index.n_stale == len(rows) - len(expected)
    assert index.keys["ratio"].to_pylist() == expected["ratio"].to_pylist()
    assert [counted for _, counted in index.part_sizes()] == [len(part) for part in index.parts()]
    run_table.remove_parts(fs, index.names)  # by a run that goes on, say
    places = rng.permutation(len(expected))[: len(expected) // 2]
    assert index.rows(places).equals(expected.take(pa.array(places)))
    assert index.table(["cell", "status"]).equals(expected.select(["cell", "status"]))
    index.close()


def test_a_run_without_parts(tmp_path):
    index = open_index(*run_table.open_run(str(tmp_path / "none")))
    assert (len(index), index.names, index.part_sizes(), list(index.parts())) == (0, [], [], [])


def test_a_part_of_an_older_version(tmp_path):
    """Columns that it did not write are null, and numbers may be of another type."""
    (tmp_path / "rows").mkdir()
    old = pa.table({"file": ["b", "a"], "n_faces": pa.array([4, 8], pa.int32())})
    pq.write_table(old, tmp_path / "rows" / "part-1.parquet")
    index = open_index(*run_table.open_run(str(tmp_path)), ["label", "n_faces"])
    assert index.keys.select(["file", "label", "n_faces"]).to_pylist() == [
        {"file": "a", "label": None, "n_faces": 8}, {"file": "b", "label": None, "n_faces": 4},
    ]  # fmt: skip
    index.close()
