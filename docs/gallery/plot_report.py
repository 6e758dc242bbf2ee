"""
A data set and its report
=========================

Shapes of several families in a folder, one table row each, one report. A file that is no mesh costs only its own row.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pyarrow.parquet
from PIL import Image

from voxkernel.demo_shapes import comet, face, gem, s_prism, star_prism, torus, urchin
from voxkernel.report import write_report

# %%
# A folder of meshes
# ------------------
# The name of a sub-folder is the label.
folder = Path(tempfile.mkdtemp())
families = {
    "star": [star_prism(n, inner) for n, inner in ((5, 0.45), (7, 0.6), (9, 0.3))],
    "spiky": [urchin(subdivisions=4, length=length) for length in (0.2, 0.5, 0.8)],
    "face": [face(hook=hook, rings=24, sectors=48) for hook in (0.0, 0.2, 0.45)],
    "other": [gem(), s_prism(), torus(n_major=48, n_minor=24), comet(rings=30, sectors=32)],
}
for label, shapes in families.items():
    (folder / "shapes" / label).mkdir(parents=True)
    for i, shape in enumerate(shapes):
        shape.write(folder / "shapes" / label / f"{shape.source}_{i}.ply")
(folder / "shapes" / "other" / "broken.ply").write_text("not a mesh")

# %%
# Evaluate and report
# -------------------
# On a command line: ``voxkernel evaluate shapes -o run --labels folders --thumbnails --views all``. The exit code is 1
# because a mesh failed. Worker processes import the script that starts them, so a script that calls
# ``voxkernel.evaluate`` itself must do it under ``if __name__ == "__main__":``.
options = ["--labels", "folders", "--thumbnails", "--views", "all", "--workers", "1", "--quiet"]
command = [sys.executable, "-m", "voxkernel.cli.main", "evaluate", "shapes", "-o", "run", *options]
done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
print(done.stdout, done.stderr)
assert done.returncode == 1
write_report("report.html", folder / "run", title="Shapes by formula")

# %%
# The table
# ---------
table = pyarrow.parquet.read_table(folder / "run" / "rows").sort_by("file").to_pylist()
for row in table:
    outcome = row["verdict"] or row["reason"].splitlines()[0][:60]
    print(f"{row['label']:6s} {Path(row['file']).name:18s} {row['status']:7s} {outcome}")

# %%
# The picture
# -----------
# :download:`The report itself </made/extra/report.html>` is one file that needs no network: sort, filter, turn the
# shapes by hand. This is drawn from the same table.
chart = plt.figure(figsize=(13, 6.2), layout="constrained")
pictures, bars = chart.subfigures(1, 2, width_ratios=(1.25, 1))
shown = [row for row in table if row["thumbnail"]]
axes = pictures.subplots(4, 4)
for panel in axes.flat:
    panel.axis("off")
for panel, row in zip(axes.flat, shown, strict=False):
    panel.imshow(np.asarray(Image.open(folder / "run" / row["thumbnail"])))
    panel.set_title(Path(row["file"]).stem, fontsize=9)
above, below = bars.subplots(2, 1)
colors = {"star-shaped": "#e8650a", "degenerate": "#c9b03a", "not star-shaped": "#5d6b7a", "failed": "#d3202f"}
verdicts = [row["verdict"] or "failed" for row in table]
names = list(colors)
counts = [verdicts.count(name) for name in names]
above.barh(names[::-1], counts[::-1], color=list(colors.values())[::-1])
above.set_title("verdicts", fontsize=11)
ranked = [row for row in table if row["status"] == "ok" and row["violation_upper"] > 0]
ranked.sort(key=lambda row: row["violation_upper"])
below.barh([Path(r["file"]).stem for r in ranked], [100 * r["violation_upper"] for r in ranked], color="#5d6b7a")
below.set_title("turned away from the best point, % of the area", fontsize=11)
chart.savefig("report.png", dpi=110)
plt.close(chart)

# %%
# Limits
# ------
# A report shows what the table says; it opens no mesh. :doc:`/howto/data_sets` has clusters, time limits and the
# columns of the table.
#
# Source of the kernels in the pictures: N. Werghi, 2008; see :doc:`/references`. The scores are ours.
