"""`evaluate` beside a plain loop over the same meshes: throughput at 1 and 2 processes, and what the engine costs.

1,000 meshes of 5k facets by default; VOXKERNEL_BENCH_MESHES sets another number.
"""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from synthetic import bumpy

import voxkernel
from voxkernel import run_table
from voxkernel.evaluation import EvaluateSettings, evaluate
from voxkernel.evaluation.analysis import analyse, warm_up

N = int(os.environ.get("VOXKERNEL_BENCH_MESHES", "1000"))
N_SMALL = 10 * N
TETRAHEDRON = "OFF\n4 4 0\n0 0 0\n{0} 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    """Bodies of 5k facets: star-shaped ones and, where the bumps are high, others."""
    folder = tmp_path_factory.mktemp("large")
    amplitudes = np.linspace(0.05, 1.0, 20)
    made = [voxkernel.TriangleMesh.from_triangles(*bumpy(5000, a, seed=k)) for k, a in enumerate(amplitudes)]
    for k in range(N):
        vertices, faces = made[k % 20].vertices * (1.0 + k / N), made[k % 20].faces
        voxkernel.TriangleMesh.from_triangles(vertices, faces).write(folder / f"{k:05}.ply")
    return folder


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    folder = tmp_path_factory.mktemp("small")
    for k in range(N_SMALL):
        text = TETRAHEDRON.format(1 + k / 8)
        (folder / f"{k:05}.off").write_text(text[: len(text) // 2] if k % 100 == 7 else text)
    return folder


def plain_loop(folder, run):
    """What one would write without an engine; the table is written at the end."""
    rows = []
    for path in sorted(folder.iterdir()):
        try:
            (row,) = analyse(str(path), EvaluateSettings(), name="").rows
            rows.append({"file": str(path), "status": "ok", **row})
        except voxkernel.VoxKernelError as error:
            rows.append({"file": str(path), "status": "failed", "reason": str(error)})
    fs, path = run_table.open_run(str(run))
    run_table.write_part(fs, path, rows)
    return run_table.read_rows(str(run))


def with_engine(folder, run, workers):
    shutil.rmtree(run, ignore_errors=True)
    return evaluate(folder, output=run, settings=EvaluateSettings(workers=workers)).table()


def compare(side_by_side, case, folder, runs):
    warm_up()
    answer = side_by_side(
        case,
        {
            "plain loop": lambda: plain_loop(folder, runs / "plain"),
            "evaluate, 1 process": lambda: with_engine(folder, runs / "one", 1),
            "evaluate, 2 processes": lambda: with_engine(folder, runs / "two", 2),
        },
        rounds=1,
    )
    plain, one, two = (table for _, table in answer.values())
    for table in (one, two):
        for column in ("file", "status", "ratio", "violation_upper", "profile_shares"):
            assert table[column].equals(plain[column])
    return two


def test_throughput(side_by_side, large, tmp_path):
    table = compare(side_by_side, f"{N} meshes of 5k facets", large, tmp_path)
    assert table["status"].to_pylist() == ["ok"] * N


def test_overhead_on_small_meshes(side_by_side, small, tmp_path):
    table = compare(side_by_side, f"{N_SMALL} tetrahedra, 1 % of the files broken", small, tmp_path)
    failed = [
        Path(f).stem for f, s in zip(*(table[c].to_pylist() for c in ("file", "status")), strict=True) if s != "ok"
    ]
    assert failed == [f"{k:05}" for k in range(7, N_SMALL, 100)]


def test_nothing_to_do(side_by_side, small, tmp_path):
    with_engine(small, tmp_path, 2)
    side_by_side(
        f"{N_SMALL} rows there already",
        {"evaluate": lambda: evaluate(small, output=tmp_path, settings=EvaluateSettings())},
    )
