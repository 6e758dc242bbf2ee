"""Workers that crash, hang or run out of memory, clients that are killed: what a run loses, which is nothing finished.

Instead of meshes that trip a reader, `naughty` reads the name of a file and does what it says.
"""

import multiprocessing
import os
import random
import signal
import sys
import time
from pathlib import Path

import pytest
from faulty_runs import (
    COMMAND,
    SCRIPT,
    client,
    comparable,
    evaluated,
    failures,
    files,
    is_alive,
    n_on_disk,
    stored,
    wait_for_rows,
)

from voxkernel._fork_server import start_method
from voxkernel.evaluation import EvaluateSettings, evaluate
from voxkernel.evaluation.evaluate import run_evaluation

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals")


def test_each_costs_its_own_row_only(tmp_path):
    folder = files(tmp_path / "in", 60, "segfault", "hang", "memory", "raises", "exit", "once")
    result = evaluated(folder, tmp_path / "run", timeout=2.0, memory_limit="2GB")
    assert (result.n_ok, result.n_failed) == (61, 5)
    reasons = failures(result)
    assert reasons["segfault"] == "its worker process was killed by SIGSEGV, 2 times"
    assert reasons["hang"] == "took longer than 2 s: its worker was killed"
    assert reasons["memory"].startswith("out of memory: Unable to allocate")
    assert reasons["memory"].endswith(", within the 2GB that a worker may use")
    assert reasons["raises"] == "RuntimeError: oh no"
    assert reasons["exit"] == "its worker process ended with exit code 7, 2 times"
    assert all(len(r["content_hash"]) == 64 for r in result.table().to_pylist())

    # What failed is not tried again unless asked for, even though workers died of it.
    before = stored(tmp_path / "run")
    assert evaluated(folder, tmp_path / "run", timeout=2.0).n_reused == 66
    assert stored(tmp_path / "run") == before  # with the times at which they were finished


def test_worker_killed_from_outside_costs_nothing(tmp_path):
    folder = files(tmp_path / "in", 60, every="slow")
    killed = []

    def kill_one(state):
        workers = multiprocessing.active_children()
        if state.done >= 10 * (len(killed) + 1) and len(killed) < 2 and workers:
            killed.append(workers[len(killed) % len(workers)].pid)
            os.kill(killed[-1], signal.SIGKILL)

    result = evaluated(folder, tmp_path / "run", kill_one)
    assert len(killed) == 2
    assert (result.n_ok, result.n_failed, result.n_rows) == (60, 0, 60)


def test_progress_counts_what_is_on_disk(tmp_path):
    folder, run = files(tmp_path / "in", 50, every="slow"), tmp_path / "run"
    wrong = []

    def look(state):
        on_disk = n_on_disk(run)
        if on_disk < state.done:
            wrong.append((on_disk, state.done))

    evaluated(folder, run, look, workers=1)
    assert not wrong


def test_real_scheduler(tmp_path):
    from dask import config
    from distributed import LocalCluster

    folder = files(tmp_path / "in", 20, "segfault", "hang")
    nothing = {"dashboard_address": None, "silence_logs": 60, "local_directory": str(tmp_path)}
    nothing["scheduler_kwargs"] = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}
    forked = config.set({"distributed.worker.multiprocessing-method": start_method(for_analysis=False)})
    with forked, LocalCluster(n_workers=2, threads_per_worker=1, processes=True, **nothing) as cluster:
        options = {"scheduler": cluster.scheduler_address, "timeout": 2.0}
        result = evaluated(folder, tmp_path / "run", **options)
        assert failures(result).keys() == {"segfault", "hang"}
        assert failures(result)["segfault"] == "its worker was lost 2 times"
        assert failures(result)["hang"] == "took longer than 2 s: its worker was killed"
        assert result.n_ok == 20


def test_what_cannot_be_sent_is_an_error(tmp_path):
    folder = files(tmp_path / "in", 3)
    lock = multiprocessing.Lock()
    with pytest.raises(Exception, match=r"(?i)pickle|serializ|inheritance"):
        run_evaluation([folder], str(tmp_path / "run"), EvaluateSettings(workers=1), None, None, lambda: lock)


@pytest.mark.slow
def test_memory_that_the_system_does_not_limit(tmp_path):
    folder = files(tmp_path / "in", 3, "grows")
    result = evaluated(folder, tmp_path / "run", workers=1, memory_limit="600MB")
    assert failures(result) == {"grows": "out of memory: its worker was killed at the limit of 600MB"}


@pytest.mark.slow
def test_ten_thousand_meshes_with_one_per_cent_broken(tmp_path, rng):
    """Exactly the broken ones are reported, each with its reason."""
    folder = tmp_path / "in"
    folder.mkdir()
    tetrahedron = "OFF\n4 4 0\n0 0 0\n{0} 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
    spoil = (
        lambda text: text[: len(text) // 2],
        lambda text: "",
        lambda text: text.replace("0 1 0", "0 nan 0"),
        lambda text: text.replace("3 1 2 3", "3 1 2 9"),
        lambda text: "no mesh",
    )
    broken = set(rng.choice(10_000, 100, replace=False).tolist())
    for k in range(10_000):
        text = tetrahedron.format(1 + k / 8)
        (folder / f"{k:05}.off").write_text(spoil[k % 5](text) if k in broken else text)
    result = evaluate(folder, output=tmp_path / "run", settings=EvaluateSettings(workers=2))
    assert (result.n_rows, result.n_ok, result.n_failed) == (10_000, 9_900, 100)
    table = result.table().to_pylist()
    assert {int(Path(row["file"]).stem) for row in table if row["status"] == "failed"} == broken
    assert all(row["reason"] for row in table if row["status"] == "failed")
    assert all(row["volume"] == pytest.approx((1 + k / 8) / 6) for k, row in enumerate(table) if k not in broken)
    assert evaluate(folder, output=tmp_path / "run", settings=EvaluateSettings(workers=2)).n_reused == 10_000


# ---------------------------------------------------------------- the client ends

@pytest.mark.parametrize(("n", "kills"), [(60, 1), pytest.param(80, 2, marks=pytest.mark.slow)])
def test_client_killed_at_random_times(tmp_path, n, kills):
    import psutil

    folder, run = files(tmp_path / "in", n, "raises", every="slow"), tmp_path / "run"
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    dice = random.Random(int(os.environ.get("VOXKERNEL_SEED", "0")))
    kept, children = {}, []
    for _ in range(kills):
        process = client(script, folder, run)
        wait_for_rows(run, min(len(kept) + 1, n + 1), process)
        time.sleep(dice.uniform(0.0, 0.6))
        found = psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []
        children += [child.pid for child in found]
        before = stored(run)
        process.kill()
        process.communicate()
        now = stored(run)
        assert kept.items() <= now.items()
        assert before.items() <= now.items()
        kept = now
    assert 0 < len(kept) < n + 1
    process = client(script, folder, run)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, err
    n_reused = int(out.split()[2])
    assert n_reused == len(kept)
    final = stored(run)
    assert kept.items() <= final.items()
    whole = evaluated(folder, tmp_path / "whole", timeout=20.0)
    assert (whole.n_ok, whole.n_failed) == (n, 1)
    assert comparable(final) == comparable(stored(tmp_path / "whole"))
    end = time.monotonic() + 120
    while any(map(is_alive, children)) and time.monotonic() < end:
        time.sleep(0.2)
    assert not any(map(is_alive, children)), "worker processes outlived their client"


def test_ctrl_c(tmp_path):
    folder, run = files(tmp_path / "in", 400, every="slow"), tmp_path / "run"
    script = tmp_path / "script.py"
    script.write_text(COMMAND)
    process = client(script, "evaluate", folder, "-o", run, "--workers", 2)
    wait_for_rows(run, 5, process)
    os.killpg(process.pid, signal.SIGINT)  # a terminal sends it to all of the group
    out, err = process.communicate(timeout=120)
    assert process.returncode == 130
    assert out == ""
    assert "voxkernel: error: interrupted" in err
    assert "Traceback" not in err
    n = len(stored(run))
    assert 5 <= n < 400
    assert all(row["status"] == "ok" for row in stored(run).values())


def test_script_without_guard_is_told(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.replace('__name__ == "__main__"', "True"))
    process = client(script, files(tmp_path / "in", 3), tmp_path / "run")
    _, err = process.communicate(timeout=120)
    assert process.returncode == 1
    assert err.splitlines()[-1].startswith("voxkernel.errors.SolverError: worker processes did not start")
    assert """under `if __name__ == "__main__":`""" in err.splitlines()[-1]
