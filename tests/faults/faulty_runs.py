"""Runs that go wrong on purpose: a stand-in for `analyse` that does what a file's name says, and clients to kill."""

import ctypes
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

import voxkernel
from voxkernel import run_table
from voxkernel.evaluation import EvaluateSettings
from voxkernel.evaluation.analysis import Analysis, analyse
from voxkernel.evaluation.evaluate import run_evaluation
from voxkernel.evaluation.file_stamp import STAMP_COLUMNS

HERE = Path(__file__).resolve().parent
PICTURE = 60_000


def naughty(path, settings, *, name, view=False):
    """Stand in for `analyse`, in a worker."""
    word = Path(path).stem.partition("-")[2]
    Path(path).read_text()
    files = {}
    if word == "segfault":
        ctypes.string_at(0)
    elif word == "hang":  # holds the interpreter's lock
        ctypes.PyDLL(None).sleep(1000)
    elif word == "pause":
        time.sleep(1000)
    elif word == "memory":
        np.ones(10**10)
    elif word == "raises":
        raise RuntimeError("oh\nno")
    elif word == "exit":
        os._exit(7)
    elif word == "once" and not Path(path + ".mark").exists():
        Path(path + ".mark").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    elif word == "grows":  # past the limit at which allocations fail, to the nanny's
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (resource.RLIM_INFINITY,) * 2)
        kept = []
        for _ in range(60):
            kept.append(np.ones(5 * 10**6))
            time.sleep(0.05)
    elif word == "slow":
        time.sleep(0.05)
    elif word == "picture":
        time.sleep(0.05)
        files = {f"thumbnails/{name}.png": bytes(PICTURE)}
    row = {"verdict": "star-shaped", "ratio": float(Path(path).stem.partition("-")[0])}
    return Analysis(({**row, "thumbnail": next(iter(files), "")},), files)


def naughty_objects(path, settings, *, name, view=False, ids, rows=()):
    """Stand in for `analyse` of a label image: some objects have their ways, all take their time."""
    for number in map(int, ids):
        time.sleep(0.02)
        if number == 207:
            raise RuntimeError("oh no")
        if number == 211:
            ctypes.string_at(0)
        if number == 213:
            time.sleep(1000)
    return analyse(path, settings, name=name, ids=ids)


def image_of_objects(path, n):
    image = np.zeros((3, 4, 3 * n + 1), np.uint16)
    for k in range(n):
        image[1:, 1:3, 3 * k + 1 : 3 * k + 3] = k + 1
    np.save(path, image)
    return path


def objects_evaluated(image, run, **options):
    settings = EvaluateSettings(**{"workers": 1, "spacing": (1, 1, 1), "n_rays": (8,), **options})
    return run_evaluation([image], str(run), settings, None, None, naughty_objects)


OBJECTS = """
import sys
from faulty_runs import objects_evaluated
if __name__ == "__main__":
    result = objects_evaluated(sys.argv[1], sys.argv[2])
    print(result.n_rows, result.n_ok, result.n_reused)
"""


def files(folder, n, *words, every="good"):
    folder.mkdir()
    for k in range(n):
        (folder / f"{k:03}-{every}.ply").write_text(f"{k}")
    for k, word in enumerate(words):
        (folder / f"{n // 2:03}.{k}-{word}.ply").write_text(word)
    return folder


def evaluated(folder, run, progress=None, **options):
    settings = EvaluateSettings(**{"workers": 2, **options})
    return run_evaluation([folder], str(run), settings, None, progress, naughty)


def failures(result):
    rows = result.table().to_pylist()
    return {Path(r["file"]).stem.partition("-")[2]: r["reason"] for r in rows if r["status"] == "failed"}


SCRIPT = """
import sys
from pathlib import Path
from faulty_runs import evaluated
if __name__ == "__main__":
    result = evaluated(Path(sys.argv[1]), sys.argv[2], timeout=20.0)
    print(result.n_ok, result.n_failed, result.n_reused)
"""


def client(script, *words, **options):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(voxkernel.__file__).parents[1]), str(HERE)])}
    command = [sys.executable, str(script), *map(str, words)]
    return subprocess.Popen(
        command, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, **options
    )


def stored(run):
    return {row["file"]: row for row in run_table.read_rows(str(run)).to_pylist()} if Path(run, "rows").exists() else {}


def n_on_disk(run):
    """Rows of the parts there are, from their footers alone: asked often, beside a run on the same processors."""
    n = 0
    for part in Path(run).glob("rows/part-*.parquet"):
        with suppress(FileNotFoundError):  # it has just become a part of a larger one
            n += pq.read_metadata(part).num_rows
    return n


def wait_for_rows(run, n, process, seconds=300.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end and process.poll() is None:
        if n_on_disk(run) >= n and len(stored(run)) >= n:
            return
        time.sleep(0.02)


def comparable(rows):
    """Rows by file, in the order of the table, without what no two runs share."""
    own = ("finished", *STAMP_COLUMNS)
    return [(f, {k: v for k, v in r.items() if k not in own and "seconds" not in k}) for f, r in rows.items()]


def unfinished(run):
    """Files that a run has begun and not finished."""
    return [str(file) for file in Path(run).rglob(".*") if file.name != ".lock"]


def is_alive(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


COMMAND = """
import sys
import voxkernel.evaluation.evaluate
from voxkernel.cli import main as cli
import faulty_runs
if __name__ == "__main__":
    sys.modules["voxkernel.evaluation.evaluate"].analyse = faulty_runs.naughty
    sys.exit(cli.main(sys.argv[1:]))
"""
