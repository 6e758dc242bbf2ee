"""
Time against facets, time against depth
=======================================

Two charts from the raw seconds that lie beside :doc:`/benchmarks`, which says on what machine and by which command
they were measured. Nothing is timed here.
"""

import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

raw = Path("../benchmarks")  # seen from docs/gallery, and from docs/images


def seconds(run):
    """The rows of one run: test name to seconds per rival."""
    rows = json.loads((raw / f"{run}.json").read_text(encoding="utf-8"))["rows"]
    return {row["test"]: (row["case"], row["seconds"]) for row in rows}


every, octree = seconds("2026-11-22-all"), seconds("2026-11-22-octree")
exact = seconds("2026-11-27-exact")

# %%
# Time against facets
# -------------------
# The exact kernel beside SciPy (HiGHS over all rows, then Qhull), on bodies whose kernels have few, many, and as many
# faces as the surface. Measured by ``python -m pytest tests/benchmarks/test_exact_kernel.py`` on 2026-11-27.
chart, axes = plt.subplots(1, 3, figsize=(12, 3.9), sharey=True, layout="constrained")
for panel, kind in zip(axes, ("small", "medium", "large"), strict=True):
    found = [exact[f"test_exact_kernel[{kind}-{n}]"] for n in (1_000, 10_000, 100_000, 1_000_000)]
    facets = [int(case.split()[0]) for case, _ in found]
    for rival, color, mark in (("scipy", "#5d6b7a", "s--"), ("voxkernel", "#e8650a", "o-")):
        panel.loglog(facets, [times[rival] for _, times in found], mark, color=color, label=rival)
    panel.set(title=f"{kind} kernel", xlabel="facets")
    panel.grid(alpha=0.3)
axes[0].set_ylabel("seconds")
axes[0].legend(frameon=False)
chart.savefig("time_against_facets.png", dpi=110)
plt.close(chart)

# %%
# Time against depth
# ------------------
# Left the exact octree, 200 and 2,000 planes, beside a sweep of every plane over every point of the grid, with and
# without leaving a point at its first violation; that was measured at depth 7 (crosses) and is drawn eight times
# dearer per level. Right the relaxed octree on a face of 11,522 facets; its sweep was measured at depths 5 and 6.
# ``python -m pytest tests/benchmarks/test_voxel_kernel.py`` (run "octree") and ``test_relaxed.py`` (run "all").
chart, (left, right) = plt.subplots(1, 2, figsize=(12, 4.6), sharey=True, layout="constrained")
depths = np.arange(6, 11)
for planes, color in ((200, "#f2a468"), (2000, "#e8650a")):
    times = [octree[f"test_beside_prototype[{planes}-{d}]"][1]["voxel_kernel"] for d in depths]
    left.semilogy(depths, times, "o-", color=color, label=f"voxel_kernel, {planes:,} planes")
    swept = octree[f"test_beside_dense_sweep[{planes}]"][1]
    for rival, style in (("dense sweep", "--"), ("dense sweep, early exit", ":")):
        grey = "#9aa5b1" if planes == 200 else "#2f4460"
        left.semilogy(depths, swept[rival] * 8.0 ** (depths - 7), style, color=grey, lw=1.2)
        left.semilogy([7], [swept[rival]], "x", color=grey, label=f"{rival}, {planes:,} planes")
left.set(title="exact kernel", xlabel="depth", ylabel="seconds", xticks=depths)
grown = every["test_growth_per_level"][1]
right.semilogy(depths, [grown[f"depth {d}"] for d in depths], "o-", color="#e8650a", label="relaxed octree, alpha 0.03")
swept = [every[f"test_beside_the_dense_sweep[{d}]"][1]["dense sweep"] for d in (5, 6)]
levels = np.arange(5, 11)
right.semilogy(levels, swept[1] * 8.0 ** (levels - 6.0), "--", color="#2f4460", lw=1.2)
right.semilogy([5, 6], swept, "x", color="#2f4460", label="dense sweep, two threads")
right.set(title="relaxed kernel of a face", xlabel="depth", xticks=levels)
for panel in (left, right):
    panel.grid(alpha=0.3)
    panel.legend(frameon=False, fontsize=8, loc="upper left")
chart.savefig("time_against_depth.png", dpi=110)
plt.close(chart)

# %%
# Limits
# ------
# Seconds of one virtual machine on one day; compare ratios. Dashed and dotted lines are extrapolated from the crosses.
# Why the curves have these slopes: :doc:`/theory/octree_cost`.
#
# Source of the dense sweep: N. Werghi, 2008, section II.A; of Qhull: C. B. Barber and others, 1996. See
# :doc:`/references`.
