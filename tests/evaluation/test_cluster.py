"""The cluster of an evaluation: who can reach it, and that workers come back. The rest about those is in `faults/`."""

import asyncio
import inspect
import multiprocessing.util
import os
import signal
import sys
import time
import urllib.error
import urllib.request

import distributed
import psutil
import pytest

from voxkernel.evaluation import EvaluateSettings
from voxkernel.evaluation.cluster import connected


@pytest.fixture(scope="module")
def cluster():
    with connected(EvaluateSettings(workers=1), 1) as made:
        yield made


def answer(address, security=None):
    """What a server says to whoever asks who it is; with the rights to ask that, code can be run too."""
    from distributed.core import connect

    async def ask():
        options = security.get_connection_args("client") if security is not None else {}
        comm = await connect(address, timeout=5, **options)
        try:
            await comm.write({"op": "identity", "reply": True})
            return await comm.read()
        finally:
            comm.abort()

    return asyncio.run(ask())


def servers(cluster):
    nannies = [worker["nanny"] for worker in cluster.client.scheduler_info()["workers"].values()]
    return {"Scheduler": cluster.client.scheduler.address, "Worker": next(iter(cluster.workers())), "Nanny": nannies[0]}


@pytest.mark.parametrize("kind", ["Scheduler", "Worker", "Nanny"])
def test_only_those_with_the_key_of_the_run_are_answered(cluster, kind):
    from distributed import Security

    address = servers(cluster)[kind]
    assert answer(address, cluster.client.security)["type"] in (kind, "RecordingNanny")
    with pytest.raises(OSError, match=r"(?i)ssl|tls|certificate|closed|timed out"):
        answer(address, Security.temporary())
    with pytest.raises(OSError, match=r"(?i)timed out|closed|connect"):
        answer(address.replace("tls://", "tcp://"))


def test_it_listens_on_this_machine_only(cluster):
    assert {address.rpartition(":")[0] for address in servers(cluster).values()} == {"tls://127.0.0.1"}


def test_it_has_no_pages(cluster):
    info = cluster.client.scheduler_info()
    ports = [info["services"]["dashboard"], *(w["services"]["dashboard"] for w in info["workers"].values())]
    assert len(ports) == 2
    for port in ports:
        for page in ("info/main/workers.html", "json/counts.json", "metrics", "health", "status"):
            with pytest.raises(urllib.error.HTTPError, match="404") as caught:
                urllib.request.urlopen(f"http://127.0.0.1:{port}/{page}", timeout=30)
            caught.value.close()


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_a_killed_worker_comes_back_however_long_it_takes():
    """Dask closes the nanny of a worker that is not back in time, which on a busy machine it may not be."""
    from dask import config

    with (
        config.set({"distributed.deploy.lost-worker-timeout": "10ms"}),
        connected(EvaluateSettings(workers=1), 1) as cluster,
    ):
        for _ in range(2):
            before = cluster.workers()
            os.kill(next(iter(cluster.client.run(os.getpid).values())), signal.SIGKILL)
            end = time.monotonic() + 120
            while cluster.workers() <= before and time.monotonic() < end:
                time.sleep(0.05)
            assert len(cluster.workers() - before) == 1


def test_what_is_private_in_dask_is_still_there():
    """What `RecordingNanny` overrides and reads; pyproject.toml bounds the version for its sake."""
    from distributed import Nanny
    from distributed.worker_memory import NannyMemoryManager

    assert list(inspect.signature(Nanny._on_worker_exit_sync).parameters) == ["self", "exitcode"]
    assert "self._on_worker_exit_sync" in inspect.getsource(Nanny)
    assert "self._last_terminated_pid = " in inspect.getsource(NannyMemoryManager)
    assert isinstance(inspect.getattr_static(Nanny, "pid"), property)
    assert isinstance(distributed.utils._forkserver_preload_set, bool)
    assert "_config.get('tempdir')" in inspect.getsource(multiprocessing.util.get_temp_dir)


@pytest.mark.skipif(sys.platform != "linux", reason="worker processes are forks on Linux only")
def test_workers_are_forks_of_a_process_with_one_thread(cluster):
    """Forks of more threads than one may hang. It is this process's child, and ends with it."""
    server = psutil.Process(psutil.Process(next(iter(cluster.client.run(os.getpid).values()))).ppid())
    assert server.ppid() == os.getpid()
    assert server.num_threads() == 1
    assert any("forkserver" in word for word in server.cmdline())
    with connected(EvaluateSettings(workers=1), 1) as other:
        again = psutil.Process(next(iter(other.client.run(os.getpid).values()))).ppid()
    assert again == server.pid


def test_workers_have_the_environment_of_their_run(cluster, monkeypatch):
    """What was set after the first workers started too; and one thread of each library."""
    monkeypatch.setenv("VOXKERNEL_TEST", "later")
    before = dict(os.environ)
    with connected(EvaluateSettings(workers=1), 1) as other:
        seen = next(iter(other.client.run(lambda: dict(os.environ)).values()))
    assert seen["VOXKERNEL_TEST"] == "later"
    assert seen["OMP_NUM_THREADS"] == seen["OPENBLAS_NUM_THREADS"] == "1"
    assert before["VOXKERNEL_TEST"] == os.environ["VOXKERNEL_TEST"]
