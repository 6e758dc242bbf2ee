"""A data set of a million files and the run that an evaluation would have left: how long resume and report take.

python tests/benchmarks/million_rows.py FOLDER [--rows 1000000] [--json FILE]

The files are hard links to 25 tetrahedra, a tenth of which do not close, so that the disk holds few of them; with
`rehash` each is read and hashed all the same. The rows are those of these files, with other numbers, in
parts as `evaluate` makes them. Each step runs in a process of its own; the seconds are of the whole process, the memory
is its largest resident set.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow as pa

from voxkernel import run_table
from voxkernel.evaluation import EvaluateSettings
from voxkernel.evaluation.analysis import analyse
from voxkernel.evaluation.file_stamp import STAMP_COLUMNS, stamp_of
from voxkernel.evaluation.inputs import Item, content_hash
from voxkernel.evaluation.settings import settings_hash, settings_text, versions_text

SHAPES, IN_FOLDER, IN_PART = 25, 1000, 100_000
RESUME = """
import sys, voxkernel
if __name__ == "__main__":
    settings = voxkernel.EvaluateSettings(rehash=sys.argv[3] == "rehash")
    result = voxkernel.evaluate(sys.argv[1] + "/in", output=sys.argv[1] + "/run", settings=settings)
    assert result.n_reused == result.n_rows == int(sys.argv[2]), result
"""
REPORT = """
import sys, voxkernel
summary = voxkernel.write_report(sys.argv[1] + "/report.html", sys.argv[1] + "/labelled")
assert summary["n_rows"] == int(sys.argv[2])
"""


def make_files(folder, n):
    """Folders of a thousand files each; the same order as in the table."""
    shapes = folder / "shapes"
    shapes.mkdir(parents=True)
    for k in range(SHAPES):
        faces = ["3 0 2 1", "3 0 1 3", "3 0 3 2", "3 1 2 3"][: 3 if k % 10 == 7 else 4]
        text = f"OFF\n4 {len(faces)} 0\n0 0 0\n{1 + k / 8} 0 0\n0 1 0\n0 0 1\n" + "\n".join(faces) + "\n"
        (shapes / f"{k:02}.off").write_text(text)
    for k in range(n):
        place = folder / "in" / f"{k // IN_FOLDER:04}"
        if k % IN_FOLDER == 0:
            place.mkdir(parents=True)
        os.link(shapes / f"{k % SHAPES:02}.off", place / f"{k:07}.off")


def make_run(folder, n, name, labels):
    """Rows as of these files, a hundredth of them failed, in parts of 100,000."""
    settings = EvaluateSettings()
    rows = []
    for k in range(SHAPES):
        file = folder / "shapes" / f"{k:02}.off"
        (row,) = analyse(str(file), settings, name="").rows
        about = {"content_hash": content_hash(Item("", str(file))), "settings_hash": settings_hash(settings)}
        about |= dict(zip(STAMP_COLUMNS, stamp_of(str(file)), strict=True))  # a link more has changed each
        texts = {"settings": settings_text(settings), "versions": versions_text()}
        rows.append({**row, **about, **texts, "status": "ok", "reason": ""})
    few = run_table.to_table(rows)
    fs, path = run_table.open_run(str(folder / name))
    rng = np.random.default_rng(7)
    last = ""
    for begin in range(0, n, IN_PART):
        ids = np.arange(begin, min(n, begin + IN_PART))
        part = one_part(folder, few.take(pa.array(ids % SHAPES)), ids, labels, rng)
        last = run_table.write_table_part(fs, path, part, after=last)
    run_table.write_settings(fs, path, {"left_out": {}})


def one_part(folder, table, ids, labels, rng):
    n = len(ids)
    failed = rng.random(n) < 0.01
    start = datetime(2026, 1, 1, tzinfo=UTC).timestamp()
    given = {
        "file": [f"{folder}/in/{k // IN_FOLDER:04}/{k:07}.off" for k in ids.tolist()],
        "label": np.array(labels, object)[ids % 2].tolist(),
        "finished": [datetime.fromtimestamp(start + k / 50, UTC).isoformat() for k in ids.tolist()],
        "status": np.where(failed, "failed", "ok").tolist(),
        "reason": np.where(failed, "MeshReadError: half a file", "").tolist(),
    }
    for name, values in given.items():
        table = table.set_column(table.column_names.index(name), name, pa.array(values, pa.string()))
    for name in run_table.COLUMNS:
        column = table[name]
        if pa.types.is_float64(column.type) and column.null_count < n:
            own = np.nan_to_num(column.to_numpy()) * rng.uniform(0.5, 1.0, n)
            table = table.set_column(table.column_names.index(name), name, pa.array(own))
    return table


def measured(script, folder, n, option=""):
    """Seconds and largest resident set of a process, with those it starts."""
    begin = time.perf_counter()
    process = subprocess.Popen([sys.executable, "-c", script, str(folder), str(n), option])
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"the process ended with {status}")
    cpu = used.ru_utime + used.ru_stime
    return {"seconds": time.perf_counter() - begin, "cpu_seconds": cpu, "megabytes": used.ru_maxrss / 1024}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    folder = args.folder.absolute()
    if not (folder / "run").exists():
        make_files(folder, args.rows)
        time.sleep(3)  # what has changed just now has no stamp
        for name, labels in (("run", [None, None]), ("labelled", ["star", "not"])):
            make_run(folder, args.rows, name, labels)
    found = {"rows": args.rows, "resume": measured(RESUME, folder, args.rows)}
    found["resume_rehash"] = measured(RESUME, folder, args.rows, "rehash")
    print(json.dumps(found), flush=True)
    found["report"] = measured(REPORT, folder, args.rows)
    found["page_megabytes"] = (folder / "report.html").stat().st_size / 1e6
    found["beside_megabytes"] = (folder / "report.rows.parquet").stat().st_size / 1e6
    found["run_megabytes"] = sum(f.stat().st_size for f in (folder / "run").rglob("*.parquet")) / 1e6
    print(json.dumps(found, indent=1))
    if args.json:
        args.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
