"""The fuzzing goes on in a process of its own beside the other tests: it is started first and asked last."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = Path(__file__).with_name("fuzz.py")
INPUTS = {
    "some": int(os.environ.get("VOXKERNEL_FUZZ_SOME", "500")),
    "many": int(os.environ.get("VOXKERNEL_FUZZ_INPUTS", "10000")),
}
SEED = int(os.environ.get("VOXKERNEL_FUZZ_SEED", "0"))
NICE = 5  # what is measured beside it comes first


class Fuzzing:
    """Runs of the formats wanted, one process for each amount of inputs."""

    def __init__(self, wanted):
        self._folder = tempfile.TemporaryDirectory(prefix="voxkernel-fuzz-")
        self._runs = {amount: self._start(amount, names) for amount, names in wanted.items() if names}

    def _start(self, amount, names):
        out = Path(self._folder.name) / amount
        out.mkdir()
        words = ["--formats", ",".join(names), "--count", str(INPUTS[amount]), "--seed", str(SEED), "--out", str(out)]
        with (out / "printed").open("wb") as printed:
            return subprocess.Popen(
                [sys.executable, str(PROGRAM), *words],
                stdout=printed,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=lambda: os.nice(NICE),
            )

    def state(self, name, amount):
        """The result of a format, once all of that amount are done; what was printed if there is none."""
        self._runs[amount].wait()
        out = Path(self._folder.name) / amount
        file = out / f"{name}-{SEED}.json"
        return json.loads(file.read_text()) if file.exists() else (out / "printed").read_text()

    def stop(self):
        """End what still runs, the children too."""
        for process in self._runs.values():
            if process.poll() is None:
                os.killpg(process.pid, 9)
                process.wait()
        self._folder.cleanup()
