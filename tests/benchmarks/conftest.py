"""Side-by-side timing: rivals take turns in one process, the minimum of several rounds counts.

Run with `pytest tests/benchmarks -p no:cacheprovider --bench-json out.json`; nothing here can fail on time.
"""

import importlib
import json
import os
import platform
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

ROWS: list[dict[str, object]] = []


def pytest_addoption(parser):
    parser.addoption("--bench-json", default=None, help="write all rows of the benchmark tables to this file")
    parser.addoption("--bench-rounds", type=int, default=5, help="rounds of the faster rivals")


@pytest.fixture
def side_by_side(request):
    """Time rivals in turns; returns {name: (seconds, last result)} and keeps a row for the table.

    A rival that takes more than two seconds runs only twice. `clock` may be `time.process_time`, for the time of the
    processor where other work runs beside.
    """

    def run(
        case: str, rivals: dict[str, Callable[[], object]], *, rounds: int | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ):  # fmt: skip
        best = dict.fromkeys(rivals, float("inf"))
        result: dict[str, object] = {}
        for k in range(rounds or request.config.getoption("--bench-rounds")):
            for name, call in rivals.items():
                if k >= 2 and best[name] > 2.0:
                    continue
                begin = clock()
                result[name] = call()
                best[name] = min(best[name], clock() - begin)
        ROWS.append({"test": request.node.name, "case": case, "seconds": dict(best)})
        return {name: (best[name], result[name]) for name in rivals}

    return run


@pytest.fixture
def prototype():
    """Import one of the throw-away prototypes the targets were set with; skip where they are not at hand."""

    def load(name: str):
        folder = Path(
            os.environ.get("VOXKERNEL_PROTOTYPES", Path(__file__).parents[3] / "shared" / "prototypes")
        )
        if not (folder / f"{name}.py").exists():
            pytest.skip(f"prototypes not found at {folder}; set VOXKERNEL_PROTOTYPES")
        if str(folder) not in sys.path:
            sys.path.append(str(folder))
        return importlib.import_module(name)

    return load


def pytest_terminal_summary(terminalreporter, config):
    for row in ROWS:
        seconds = row["seconds"]
        first = next(iter(seconds.values()))
        cells = [
            f"{n} {1e3 * s:.2f} ms" + ("" if s is first else f" ({s / first:.2f}x)")
            for n, s in seconds.items()
        ]
        terminalreporter.write_line(f"{row['test']} | {row['case']} | " + " | ".join(cells))
    path = config.getoption("--bench-json")
    if path and ROWS:
        machine = {
            "python": platform.python_version(),
            "machine": platform.machine(),
            "date": time.strftime("%Y-%m-%d"),
        }
        Path(path).write_text(json.dumps({"machine": machine, "rows": ROWS}, indent=1))
