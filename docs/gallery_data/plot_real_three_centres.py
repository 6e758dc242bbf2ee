"""
Three centres of real faces
===========================

The closest, the midway and the farthest centre of a face (Werghi 2008, figure 4), once for a scan that was smoothed
until it has a kernel, once for a face without one, whose centres are those that turn away hardly more than the best.
"""

import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import voxkernel

data = Path(os.environ["VOXKERNEL_DATA"])


def viewing_direction(mesh):
    """The direction the surface faces on average; it depends on the boundary curve only."""
    facing = mesh.facet_areas @ mesh.facet_normals
    return facing / np.linalg.norm(facing)


def kernel_segment(mesh):
    """The closest and the farthest kernel point in the viewing direction."""
    corners = voxkernel.exact_kernel(mesh).vertices
    height = corners @ viewing_direction(mesh)
    size = np.ptp(height)
    return corners[height > height.max() - 1e-9 * size].mean(axis=0), corners[
        height < height.min() + 1e-9 * size
    ].mean(axis=0)


def relaxed_segment(mesh, allowance=0.01):
    """Along the viewing direction through the best centre: points that turn away `allowance` more than it does."""
    best = voxkernel.best_center(mesh)
    size = mesh.facts().diagonal
    steps = np.linspace(-size, size, 2001)
    line = best.point + steps[:, None] * viewing_direction(mesh)
    good = voxkernel.violation(mesh, line) <= best.violation_bounds[1] + allowance
    middle = len(steps) // 2
    low, high = middle, middle
    while low > 0 and good[low - 1]:
        low -= 1
    while high < len(steps) - 1 and good[high + 1]:
        high += 1
    return line[high], line[low]


def measure(mesh, closest, farthest, n_points=17, rings=96):
    """Coverage, clearance, distortion and reconstruction error along a segment."""
    rows = []
    for t in np.linspace(0.002, 0.998, n_points):
        seen = voxkernel.spherical_map(mesh, center=(1 - t) * closest + t * farthest)
        error = seen.error(seen.reconstruct(n=rings))
        rows.append((t, seen.coverage, max(0.0, seen.clearance), seen.distortion, error.rms, seen.hidden_fraction))
    return np.array(rows).T


def draw_map(axes, mesh, center, title):
    """The radius over the part of the sphere that is covered, in the mean direction's own longitude and latitude."""
    z = viewing_direction(mesh)
    seen = voxkernel.spherical_map(mesh, center=center)
    # Azimuthal picture: the distance from the middle is the angle from the viewing direction.
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x)
    samples = seen.sample(n=180)
    d = samples.grid.directions()
    angle = np.degrees(np.arccos(np.clip(d @ z, -1, 1)))
    turn = np.arctan2(d @ np.cross(z, x), d @ x)
    shown = samples.mask.reshape(-1)
    axes.scatter(
        (angle * np.cos(turn))[shown], (angle * np.sin(turn))[shown], c=samples.radii.reshape(-1)[shown], s=1.5
    )
    for reach in (60, 120, 180):
        axes.add_patch(plt.Circle((0, 0), reach, fill=False, color="0.8", lw=0.8))
        axes.text(0, -reach + 4, f"{reach}°", ha="center", fontsize=7, color="0.5")
    axes.set(xlim=(-185, 185), ylim=(-185, 185), aspect="equal", title=f"{title}: {100 * seen.coverage:.0f} %")
    axes.axis("off")


def figure(mesh, closest, farthest, title):
    """Three maps above, the trade-off below."""
    t, coverage, clearance, distortion, rms, hidden = measure(mesh, closest, farthest)
    size = mesh.facts().diagonal
    chart = plt.figure(figsize=(11, 7.2), layout="constrained")
    above, below = chart.subfigures(2, 1, height_ratios=[1.3, 1])
    above.suptitle(title)
    for i, (share, name) in enumerate([(0.002, "closest"), (0.5, "midway"), (0.998, "farthest")]):
        draw_map(above.add_subplot(1, 3, i + 1), mesh, (1 - share) * closest + share * farthest, name)
    curves = [
        ("coverage, share of the sphere", coverage),
        ("clearance / diagonal", clearance / size),
        ("area distortion", distortion),
        ("reconstruction rms / diagonal", rms / size),
    ]
    if hidden.any():
        curves[1] = ("area turned away", hidden)
    for i, (name, values) in enumerate(curves):
        axes = below.add_subplot(1, 4, 1 + i)
        axes.plot(t, values, ".-")
        axes.set(title=name, xlabel="closest → farthest", ylim=(0, None))
        axes.title.set_fontsize(9)
        axes.grid(alpha=0.3)
    return chart


# %%
# A smoothed scan
# ---------------
smooth = voxkernel.as_mesh(data / "faces_smooth" / "smooth_ict01_neutral.ply")
chart = figure(smooth, *kernel_segment(smooth), "smooth_ict01_neutral, exact kernel")
chart.savefig("three_centres_2.png", dpi=110, bbox_inches="tight")
plt.close(chart)

# %%
# A face with an empty kernel
# ---------------------------
# Its centres lie on a line through the best one, where at most 1 % of the area more is turned away.
model = voxkernel.as_mesh(data / "faces" / "ict01_neutral.ply")
chart = figure(model, *relaxed_segment(model), "ict01_neutral, relaxed centres")
chart.savefig("three_centres_3.png", dpi=110, bbox_inches="tight")
plt.close(chart)

# %%
# Limits
# ------
# Model faces and virtual scans of them, made with ICT-FaceKit (MIT); one face each.
#
# Source: N. Werghi, 2008, figure 4; see :doc:`/references`.
