"""Turn the JSON of a benchmark run into Markdown tables: `python tests/benchmarks/to_markdown.py run.json`."""

import json
import sys
from itertools import groupby
from pathlib import Path


def main(path):
    rows = json.loads(Path(path).read_text())["rows"]
    for test, group in groupby(rows, key=lambda row: row["test"].split("[")[0]):
        print(f"\n### {test.removeprefix('test_').replace('_', ' ')}\n")
        print("| case | " + "rival: ms (ratio to the first) |\n|---|---|")
        for row in group:
            first = next(iter(row["seconds"].values()))
            cells = (f"{name}: {1e3 * s:.4g} ({s / first:.2f})" for name, s in row["seconds"].items())
            print(f"| {row['case']} | " + "; ".join(cells) + " |")


if __name__ == "__main__":
    main(sys.argv[1])
