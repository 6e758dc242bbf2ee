"""A Dask cluster for an evaluation: worker processes of this machine, or a scheduler that runs elsewhere."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from voxkernel._dask_client import client_of, result_of
from voxkernel._extras import optional
from voxkernel._fork_server import ENVIRONMENT, interrupt_blocked, start_method
from voxkernel._scratch_folder import scratch_folder
from voxkernel.errors import SolverError
from voxkernel.evaluation.inputs import BadInput
from voxkernel.evaluation.settings import EvaluateSettings

__all__ = ["Cluster", "connected"]

# A worker that dies takes one task with it; memory is not spilled, and a busy worker not given up, nor one that is slow
# to come back: after the 15 s that Dask gives it, its nanny would be closed. No pages: they have no password.
_CONFIG: dict[str, Any] = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.work-stealing": False,
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.scheduler.worker-ttl": None,
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.limit": "1h",
    "distributed.deploy.lost-worker-timeout": "1000 days",
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}  # fmt: skip
_GUARD = 'A script, which must be a file, has to call `evaluate` under `if __name__ == "__main__":`.'
_NEVER = logging.CRITICAL + 1


@dataclass(frozen=True, slots=True)
class Cluster:
    """A connected client, and how worker processes of this machine ended: exit code, and whether for their memory."""

    client: Any
    is_local: bool
    ends: dict[str, tuple[int, bool]] = field(default_factory=dict[str, tuple[int, bool]])

    def workers(self) -> set[str]:
        """Give the addresses of the workers there are now."""
        return set(self.client.nthreads())

    def result_of(self, future: Any, *, timeout: float) -> Any:
        """Give what a task has returned, or raise what it has raised."""
        return result_of(self.client, future, timeout=timeout)

    def end_of(self, address: str) -> tuple[int, bool] | None:
        """Give exit code of a local worker that is gone, and whether it was ended for its memory."""
        for _ in range(40 if self.is_local else 0):
            if address in self.ends:
                return self.ends[address]
            time.sleep(0.05)
        return None


@contextmanager
def connected(settings: EvaluateSettings, n_meshes: int, *, for_analysis: bool = True) -> Generator[Cluster]:
    """Connect to the scheduler of the settings, or start worker processes, for the analysis of meshes or another.

    Whoever reaches a scheduler or a worker can run code there, and any user of this machine reaches its ports. So
    ours talk over TLS, with a key that is made for this run and that only its processes know.
    """
    method = ""
    if settings.scheduler is None:
        method = start_method(for_analysis=for_analysis, for_pictures=bool(settings.thumbnails))
    distributed, config = optional("distributed"), optional("dask").config
    if settings.scheduler is not None:
        try:
            client = client_of(settings.scheduler)
        except ValueError as error:
            raise BadInput(str(error)) from None
        with client:
            yield Cluster(client, False)
        return
    ends: dict[str, tuple[int, bool]] = {}
    n = max(1, min(settings.workers or (os.cpu_count() or 1) // settings.threads, n_meshes))
    optional("distributed.utils")._forkserver_preload_set = True  # else it imports pandas here, for a server of its own
    with _quiet(), scratch_folder() as folder, config.set(
        {**_CONFIG, "temporary-directory": folder, "distributed.worker.multiprocessing-method": method}
    ):
        options: dict[str, Any] = {"dashboard_address": None, "local_directory": folder}
        options["env"] = {**os.environ, **ENVIRONMENT}  # what a fork has is that of its server
        options |= {"protocol": "tls://", "security": _security()}
        options["scheduler_kwargs"] = {"dashboard": False, "dashboard_address": "127.0.0.1:0"}  # else on port 8787
        try:
            with interrupt_blocked():
                made = distributed.LocalCluster(
                    n_workers=n, threads_per_worker=1, processes=True, worker_class=_recording_nanny(ends),
                    memory_limit=_memory_of_each(settings, n), silence_logs=_NEVER, host="127.0.0.1", **options,
                )  # fmt: skip
        except RuntimeError as error:
            raise SolverError(f"worker processes did not start: {error} {_GUARD}") from error
        with made, distributed.Client(made, set_as_default=False) as client:
            yield Cluster(client, True, ends)


def _memory_of_each(settings: EvaluateSettings, n: int) -> int:
    """Give the size at which a nanny ends a worker, above the limit at which allocations fail."""
    limit = settings.memory_bytes()
    if limit is not None:
        return int(limit / 0.95 * 1.25)
    cpus, memory = optional("dask.system").CPU_COUNT, optional("distributed.system").MEMORY_LIMIT
    return int(memory * 0.9 / min(n, max(1, cpus)))


def _security() -> Any:
    """Make a key for this run, as `distributed.Security.temporary` does, but on a curve, which takes no time."""
    from datetime import UTC, datetime, timedelta

    x509, hashes = optional("cryptography.x509"), optional("cryptography.hazmat.primitives.hashes")
    serialization = optional("cryptography.hazmat.primitives.serialization")
    curves = optional("cryptography.hazmat.primitives.asymmetric.ec")
    key = curves.generate_private_key(curves.SECP256R1())
    name, now = x509.Name([x509.NameAttribute(x509.oid.NameOID.COMMON_NAME, "voxkernel")]), datetime.now(UTC)
    builder = x509.CertificateBuilder().subject_name(name).issuer_name(name).public_key(key.public_key())
    builder = builder.serial_number(x509.random_serial_number())
    builder = builder.not_valid_before(now - timedelta(days=1)).not_valid_after(now + timedelta(days=365))
    cert = builder.sign(key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM).decode()
    secret = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    ).decode()
    roles = {f"tls_{role}_{what}": text for role in ("client", "scheduler", "worker")
             for what, text in (("key", secret), ("cert", cert))}  # fmt: skip
    return optional("distributed").Security(require_encryption=True, tls_ca_file=cert, **roles)


def _recording_nanny(ends: dict[str, tuple[int, bool]]) -> Any:
    """Make a nanny that notes how its workers ended: Dask tells the client only that they did."""
    nanny: Any = optional("distributed").Nanny

    class RecordingNanny(nanny):
        def _on_worker_exit_sync(self, exitcode: int) -> None:
            address, pid = self.worker_address, getattr(self, "_voxkernel_pid", None)
            if address is not None:
                ends[address] = exitcode, getattr(self.memory_manager, "_last_terminated_pid", -1) == pid
            super()._on_worker_exit_sync(exitcode)

        async def instantiate(self) -> Any:
            status = await super().instantiate()
            self._voxkernel_pid = self.pid
            return status

    return RecordingNanny


@contextmanager
def _quiet() -> Generator[None]:
    """Keep what Dask logs about dying workers off stderr: the table says it."""
    names = ("distributed", "distributed.nanny", "distributed.scheduler", "distributed.core", "tornado.application")
    loggers = [logging.getLogger(name) for name in names]
    before = [logger.level for logger in loggers]
    verbose = logging.getLogger().isEnabledFor(logging.INFO) and logging.getLogger().handlers
    try:
        for logger in loggers if not verbose else ():
            logger.setLevel(_NEVER)
        yield
    finally:
        for logger, level in zip(loggers, before, strict=True):
            logger.setLevel(level)
