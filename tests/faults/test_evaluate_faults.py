"""Faults put into running evaluations: nothing on disk is lost, and a run resumed ends as if nothing had happened.

Each compares the table with that of a run nothing has happened to: the same rows in the same order, with the same
values but for times. The random ones are slow; `VOXKERNEL_SEED` and `VOXKERNEL_FAULT_ROUNDS` choose others and more.
"""

import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import pytest
import shapes
from faulty_runs import (
    COMMAND,
    PICTURE,
    client,
    comparable,
    evaluated,
    failures,
    files,
    is_alive,
    stored,
    unfinished,
    wait_for_rows,
)

from voxkernel import as_mesh

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals")

N = 30
IS_ROOT = hasattr(os, "getuid") and os.getuid() == 0
SEED = int(os.environ.get("VOXKERNEL_SEED", "0"))
ROUNDS = range(int(os.environ.get("VOXKERNEL_FAULT_ROUNDS", "8")))


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Input files, one of which fails, and the table of a run nothing has happened to."""
    place = tmp_path_factory.mktemp("undisturbed")
    folder = files(place / "in", N, "raises", every="picture")
    evaluated(folder, place / "run", workers=1)
    return folder, comparable(stored(place / "run"))


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    """The command line, with the stand-in for `analyse`."""
    file = tmp_path_factory.mktemp("script") / "script.py"
    file.write_text(COMMAND)
    return file


@pytest.fixture
def small_disk(tmp_path):
    """A file system that is soon full, and a function that makes it large."""
    place = tmp_path / "small"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(place)]
    if not IS_ROOT:
        pytest.skip("only root can mount a small tmpfs")
    if subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("a small tmpfs cannot be mounted here")
    yield place, lambda size: subprocess.run(["mount", "-o", f"remount,size={size}", str(place)], check=True)
    subprocess.run(["umount", "-l", str(place)], check=True)


def resumes(folder, run, expected, kept):
    """Go on with a run: what was kept is reused as it is, and the table becomes the expected one.

    A part that a killed client has not moved to its name is removed, and no other file.
    """
    (Path(run) / "rows").mkdir(exist_ok=True)
    for name in ("0123456789abcdef" * 2, "mine"):
        (Path(run) / "rows" / f".{name}.tmp").write_bytes(b"half")
    result = evaluated(folder, run, workers=1)
    final = stored(run)
    assert kept.items() <= final.items()
    assert result.n_reused == len(kept)
    assert comparable(final) == expected
    assert unfinished(run) == [str(Path(run) / "rows" / ".mine.tmp")]
    assert all((Path(run) / row["thumbnail"]).stat().st_size == PICTURE for row in final.values() if row["thumbnail"])


# ---------------------------------------------------------------- one of each


@pytest.mark.parametrize(
    ("number", "to_group"), [pytest.param(signal.SIGINT, True, marks=pytest.mark.slow), (signal.SIGTERM, False)]
)
def test_interrupted_client(tmp_path, undisturbed, script, number, to_group):
    folder, expected = undisturbed
    run = tmp_path / "run"
    process = client(script, "evaluate", folder, "-o", run, "--workers", 1)
    wait_for_rows(run, 1, process)
    (os.killpg if to_group else os.kill)(process.pid, number)
    out, err = process.communicate(timeout=300)
    assert (process.returncode, out) == (130, "")
    said = [line for line in err.splitlines() if " done, " not in line]
    assert said == ["voxkernel: error: interrupted"]
    assert unfinished(run) == []
    kept = stored(run)
    assert 1 <= len(kept) < N
    resumes(folder, run, expected, kept)


# Ctrl-C while the client waits for a result that Dask is fetching, which keeps the loop busy until it has gone on.
WHILE_FETCHING = """
import atexit, gc, signal, threading, time
from distributed import Client
fetch = Client._gather
async def fetch_interrupted(self, *args, **options):
    time.sleep(0.1)
    signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
    time.sleep(0.3)
    return await fetch(self, *args, **options)
Client._gather = fetch_interrupted
atexit.register(gc.collect)  # tasks that failed unseen are told of when they are deleted
"""


@pytest.mark.slow
def test_client_interrupted_while_it_waits_for_a_result(tmp_path, undisturbed):
    """Dask has nothing to say on stderr about what it left undone."""
    folder, expected = undisturbed
    file = tmp_path / "script.py"
    file.write_text(WHILE_FETCHING + COMMAND)
    process = client(file, "evaluate", folder, "-o", tmp_path / "run", "--workers", 1, "--quiet")
    assert process.communicate(timeout=300) == ("", "voxkernel: error: interrupted\n")
    assert process.returncode == 130
    resumes(folder, tmp_path / "run", expected, stored(tmp_path / "run"))


def test_two_runs_at_once(tmp_path, undisturbed, script):
    folder, expected = undisturbed
    run = tmp_path / "run"
    (tmp_path / "link").symlink_to("run")
    first = client(script, "evaluate", folder, "-o", run, "--workers", 1)
    wait_for_rows(run, 1, first)
    first.send_signal(signal.SIGSTOP)  # it would end before the second has begun where the machine is busy
    second = client(script, "evaluate", folder, "-o", tmp_path / "link", "--workers", 1)
    out, err = second.communicate(timeout=300)
    assert (second.returncode, out, err.count("\n")) == (1, "", 1)
    first.send_signal(signal.SIGCONT)
    assert f"got '{tmp_path / 'link'}', in use by process {first.pid} on" in err
    out, err = first.communicate(timeout=120)
    assert first.returncode == 1, err  # one mesh fails
    assert comparable(stored(run)) == expected


def test_disk_full(small_disk, undisturbed):
    folder, expected = undisturbed
    place, resize = small_disk
    with pytest.raises(OSError, match="No space left on device"):
        evaluated(folder, place / "run", workers=1)
    kept = stored(place / "run")
    assert 0 < len(kept) < N
    assert unfinished(place / "run") == []
    resize("40m")
    resumes(folder, place / "run", expected, kept)


@pytest.mark.slow if IS_ROOT else lambda test: test
def test_files_that_may_not_grow(tmp_path, undisturbed, script):
    """What stands for a full disk where no file system can be mounted: rows fit, pictures do not."""
    folder, expected = undisturbed
    small = tmp_path / "small"
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (PICTURE - 1, resource.RLIM_INFINITY))  # noqa: E731
    process = client(script, "evaluate", folder, "-o", small, "--workers", 1, preexec_fn=limit)
    out, err = process.communicate(timeout=300)
    assert (process.returncode, out) == (1, "")
    said = [line for line in err.splitlines() if " done, " not in line]
    assert len(said) == 1
    assert "File too large" in said[0]
    assert unfinished(small) == []
    resumes(folder, small, expected, stored(small))


def test_file_that_vanishes(tmp_path, undisturbed, monkeypatch):
    """It was there when the run began."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    folder = shutil.copytree(undisturbed[0], tmp_path / "in")
    last = folder / f"{N - 1:03}-picture.ply"

    def vanish(_):
        last.unlink(missing_ok=True)

    result = evaluated(folder, tmp_path / "run", vanish, workers=1)
    assert result.n_failed == 2
    assert failures(result)["picture"] == f"FileNotFoundError: [Errno 2] No such file or directory: '{last}'"
    last.write_text(f"{N - 1}")
    kept = {file: row for file, row in stored(tmp_path / "run").items() if file != str(last)}
    expected = [(f.replace(str(undisturbed[0]), str(folder)), {**row, "file": row["file"].replace(
        str(undisturbed[0]), str(folder))}) for f, row in undisturbed[1]]  # fmt: skip
    resumes(folder, tmp_path / "run", expected, kept)
    assert list((tmp_path / "temporary").iterdir()) == []


def test_run_folder_that_is_read_only(request, tmp_path, undisturbed):
    folder, expected = undisturbed
    place, resize = request.getfixturevalue("small_disk") if IS_ROOT else (tmp_path, None)
    run = place / "run"
    if resize is not None:
        resize("40m")
    evaluated(folder / "010-picture.ply", run, workers=1)
    kept = stored(run)
    switch_writing(run, place, on=False)
    with pytest.raises(OSError, match=rf"`output` must be a folder that can be written to; got '{run}' \("):
        evaluated(folder, run, workers=1)
    switch_writing(run, place, on=True)
    resumes(folder, run, expected, kept)


def switch_writing(run, disk, *, on):
    if IS_ROOT:  # whom modes do not stop
        subprocess.run(["mount", "-o", f"remount,{'rw' if on else 'ro'}", str(disk)], check=True)
    else:
        for place in (run, run / "rows", run / ".lock"):
            place.chmod(0o755 if on else 0o555)


# ---------------------------------------------------------------- many at random


def client_is_killed(process, _dice):
    process.kill()


def group_is_killed(process, _dice):
    os.killpg(process.pid, signal.SIGKILL)


def client_is_interrupted(process, _dice):
    os.killpg(process.pid, signal.SIGINT)


def client_is_terminated(process, _dice):
    os.kill(process.pid, signal.SIGTERM)


def group_is_terminated(process, _dice):
    os.killpg(process.pid, signal.SIGTERM)


def worker_is_killed(process, dice):
    import psutil

    try:
        children = psutil.Process(process.pid).children(recursive=True)
        workers = [c.pid for c in children if any("spawn_main" in word for word in c.cmdline())]
        if workers:
            os.kill(dice.choice(workers), signal.SIGKILL)
    except (psutil.Error, ProcessLookupError):
        return


def file_vanishes(process, dice):
    """It is back a moment later, for the next who looks."""
    file = dice.choice(sorted(process.folder.iterdir()))
    content = file.read_bytes()
    file.unlink()
    time.sleep(dice.uniform(0.0, 0.5))
    file.write_bytes(content)


ENDS = [client_is_killed, group_is_killed, client_is_interrupted, client_is_terminated, group_is_terminated]
GOES_ON = [worker_is_killed, file_vanishes]


@pytest.mark.slow
@pytest.mark.parametrize("number", ROUNDS)
def test_faults_at_random_moments(tmp_path, script, number):
    """From the first moment of a run to its last; then it is resumed, what failed included."""
    dice = random.Random(f"{SEED} {number}")
    folder = files(tmp_path / "in", 100, "raises", every="picture")
    evaluated(folder, tmp_path / "whole")
    expected = comparable(stored(tmp_path / "whole"))
    run, temporary = tmp_path / "run", tmp_path / "temporary"
    temporary.mkdir()
    known, children = {}, []
    for _ in range(5):
        process = client_in(script, temporary, "evaluate", folder, "-o", run, "--workers", 2, "--timeout", 20)
        process.folder = folder
        if dice.random() < 0.6:
            wait_for_rows(run, len(known) + 1, process)
        time.sleep(dice.uniform(0.0, 2.5))
        for fault in [*dice.choices(GOES_ON, k=dice.randrange(3)), dice.choice(ENDS)]:
            children += descendants(process)
            with suppress(ProcessLookupError):  # it has come to its end
                fault(process, dice)
            time.sleep(dice.uniform(0.0, 0.3))
        before = stored(run)
        _, err = process.communicate(timeout=300)
        if process.returncode not in (-signal.SIGINT, -signal.SIGTERM):  # the interpreter was still importing
            assert process.returncode in (130, -signal.SIGKILL, 0, 1), err
            assert "Traceback" not in err, err
        now = stored(run)
        assert are_kept(known, now)
        assert are_kept(before, now)
        known = now
    process = client_in(script, temporary, "evaluate", folder, "-o", run, "--workers", 2, "--retry-failed")
    _, err = process.communicate(timeout=300)
    assert process.returncode == 1, err  # the one that always fails
    final = stored(run)
    assert are_kept(known, final)
    assert comparable(final) == expected
    assert unfinished(run) == []
    assert all((run / row["thumbnail"]).stat().st_size == PICTURE for row in final.values() if row["thumbnail"])
    end = time.monotonic() + 120
    while any(map(is_alive, children)) and time.monotonic() < end:
        time.sleep(0.2)
    assert not any(map(is_alive, children)), "worker processes outlived their client"
    process = client_in(script, temporary, "evaluate", folder, "-o", run, "--workers", 1, "--retry-failed")
    process.communicate(timeout=300)
    assert [path.name for path in temporary.iterdir() if path.name.startswith("voxkernel")] == []


def client_in(script, temporary, *words):
    """Start a client whose temporary files can be looked at."""
    before = os.environ.get("TMPDIR")
    os.environ["TMPDIR"] = str(temporary)
    try:
        return client(script, *words)
    finally:
        os.environ.pop("TMPDIR") if before is None else os.environ.update(TMPDIR=before)


def descendants(process):
    import psutil

    try:
        return [child.pid for child in psutil.Process(process.pid).children(recursive=True)]
    except psutil.Error:
        return []


def are_kept(before, after):
    """Whether each row that was good is still there as it was: failed ones may have been tried again."""
    return before.keys() <= after.keys() and all(
        after[file] == row or (after[file]["status"] == "ok" and row["status"] == "failed")
        or (after[file]["status"] == row["status"] == "failed")
        for file, row in before.items()
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("size", ["300k", "700k", "1500k", "3m"])
def test_disk_full_again_and_again(small_disk, undisturbed, size):
    """The disk grows a little each time."""
    folder, expected = undisturbed
    place, resize = small_disk
    resize(size)
    known, kilobytes = {}, int(float(size[:-1]) * (1000 if size.endswith("m") else 1))
    for _ in range(40):
        try:
            evaluated(folder, place / "run")
            break
        except OSError as error:
            said = str(error)
        assert "No space left on device" in said
        now = stored(place / "run")
        assert are_kept(known, now)
        assert unfinished(place / "run") == []
        known, kilobytes = now, kilobytes + 400
        resize(f"{kilobytes}k")
    assert comparable(stored(place / "run")) == expected


@pytest.mark.slow
def test_limits_of_time_and_memory_after_kills(tmp_path, script):
    """What takes too long or too much is reported the same, however often its client is killed."""
    folder = files(tmp_path / "in", 40, "hang", "pause", "memory", "segfault", "exit", every="slow")
    options = {"timeout": 2.0, "memory_limit": "2GB"}
    whole = evaluated(folder, tmp_path / "whole", **options)
    assert whole.n_failed == 5
    dice, run = random.Random(SEED), tmp_path / "run"
    words = ("evaluate", folder, "-o", run, "--workers", 2, "--timeout", 2, "--memory-limit", "2GB")
    for _ in range(4):
        process = client(script, *words)
        wait_for_rows(run, 1, process)
        time.sleep(dice.uniform(0.5, 4.0))
        process.kill()
        process.communicate()
    result = evaluated(folder, run, **options)
    assert result.n_failed == 5
    assert comparable(stored(run)) == comparable(stored(tmp_path / "whole"))


@pytest.mark.slow
def test_real_rows_after_kills(tmp_path):
    """The true analysis of shapes by formula, whose client is killed and interrupted: the same table."""
    from voxkernel.run_table import read_rows

    folder = tmp_path / "in"
    folder.mkdir()
    for k in range(24):
        torus = shapes.torus(n_major=8 + k, n_minor=6)
        made = (shapes.cube(), shapes.s_tetromino(0.01 * k), torus, shapes.star_prism())
        as_mesh(made[k % 4]).write(folder / f"{k:02}.ply")
    (folder / "broken.ply").write_text("no mesh")
    command = tmp_path / "script.py"
    command.write_text("import sys\nfrom voxkernel.cli.main import main\nif __name__ == '__main__': sys.exit(main())\n")
    words = ("evaluate", folder, "--workers", 2, "--thumbnails", "-o")
    assert exit_code(client(command, *words, tmp_path / "whole")) == 1
    dice, run = random.Random(SEED), tmp_path / "run"
    for fault in (client_is_killed, client_is_interrupted, group_is_killed, client_is_terminated):
        process = client(command, *words, run)
        wait_for_rows(run, len(stored(run)) + 1, process)
        time.sleep(dice.uniform(0.0, 0.5))
        fault(process, dice)
        process.communicate(timeout=300)
    assert exit_code(client(command, *words, run)) == 1
    assert comparable(stored(run)) == comparable(stored(tmp_path / "whole"))
    assert read_rows(str(run)).column("file").to_pylist() == sorted(stored(run))


def exit_code(process):
    """Read to its end, so that no pipe fills up or stays open."""
    process.communicate(timeout=300)
    return process.returncode
