"""
How star-shaped are the asteroids?
==================================

Small bodies are often described by a radius per direction: a grid, or spherical harmonics. That can only hold what is
seen from one centre. Yes or no is not enough of an answer: a single boulder that hangs over makes the kernel empty.
The share of the surface that the best centre cannot face (red) tells a rubble pile from two lobes.
"""

import os
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pyvista

import voxkernel
from voxkernel.demo_shapes import comet, urchin

# %%
# Bodies
# ------
# By formula: a spinning top with rough ground, a bent and elongated body, two lobes. Where ``VOXKERNEL_DATA`` names
# the folder with real shape models, Bennu, Eros and 67P/Churyumov-Gerasimenko follow below.


def rough_body(axes, ridge, bend, roughness):
    """An ellipsoid with a ridge around its equator, bent, its ground moved about in all directions."""
    ball = urchin(subdivisions=5, length=0.0)
    points = ball.vertices / np.linalg.norm(ball.vertices, axis=1)[:, None]
    points = points * (1.0 + ridge * np.exp(-((points[:, 2:] / 0.2) ** 2))) * axes
    points[:, 1] += bend * points[:, 0] ** 2
    rng = np.random.default_rng(7)
    for _ in range(24):
        wave, phase, way = 14.0 * rng.normal(size=3), rng.uniform(0, 6), rng.normal(size=3)
        points += roughness * np.sin(points @ wave + phase)[:, None] * way
    return voxkernel.as_mesh((points, ball.faces))


bodies = {
    "spinning top": rough_body((1.0, 1.0, 0.88), 0.06, 0.0, 0.009),
    "bent body": rough_body((1.7, 0.62, 0.6), 0.0, 0.22, 0.0075),
    "two lobes": voxkernel.as_mesh(comet()),
}

# %%
# The calls
# ---------
# `exact_kernel` says whether any point sees all. `best_center` brackets the least share of the area that some point
# must turn its back to; no radius about any centre in the hull shows less than that wrongly. `visible_fraction` casts
# rays from there, and so counts what is hidden behind something else as well.
degrees = (4, 8, 16, 32, 64)


def judge(name, mesh):
    """Verdict, defect, and how far a radius grid and spherical harmonics are from the surface."""
    kernel = voxkernel.exact_kernel(mesh)
    best = voxkernel.best_center(mesh, gap=1e-6, relative_gap=0.02)
    seen = voxkernel.spherical_map(mesh, center=best.point)
    visible = voxkernel.visible_fraction(mesh, best.point)
    size = mesh.facts().diagonal
    grid = seen.sample(n=180)
    errors = {"radius grid": seen.error(grid.reconstruct())}
    for degree in degrees:
        wave = seen.harmonics(degree)
        poles = wave.evaluate([[0, 0, 1], [0, 0, -1]])
        smooth = replace(grid, radii=wave.on_grid(n=180), pole_radii=poles)
        errors[degree] = seen.error(smooth.reconstruct())
    low, high = best.violation_bounds
    print(f"{name}, {mesh.n_facets} facets: kernel {'empty' if kernel.is_empty else f'of volume {kernel.volume:.3g}'}")
    print(f"  turned away from the best point: {100 * low:.4g} to {100 * high:.4g} % of the area")
    print(f"  hidden from it: {100 * visible.hidden:.3g} +- {100 * visible.error:.2g} %")
    print(f"  radius grid of 180 x 360: rms {100 * errors['radius grid'].rms / size:.3f} %, "
          f"largest {100 * errors['radius grid'].hausdorff / size:.2f} % of the diagonal")
    print(f"  harmonics of degree 64: rms {100 * errors[64].rms / size:.3f} %, "
          f"largest {100 * errors[64].hausdorff / size:.2f} %")
    return {"mesh": mesh, "map": seen, "best": best, "errors": errors, "size": size}


found = {name: judge(name, mesh) for name, mesh in bodies.items()}

# %%
# The picture
# -----------
# Facets that do not face the best centre are red. Below: the error of spherical harmonics of growing degree, and of
# the radius grid (dotted). A body that is nearly star-shaped gets better with every degree; where a part of the
# surface is not seen, no degree helps.


def draw(found, path, view=(0.4, -1.0, 0.55), up=(0, 0, 1)):
    """Bodies above, errors below."""
    size = (4.4 * len(found), 7.2)
    chart, axes = plt.subplots(2, len(found), figsize=size, layout="constrained", height_ratios=(1.3, 1))
    for (name, one), panel, curve in zip(found.items(), axes[0], axes[1], strict=True):
        data = one["mesh"].to_polydata()
        data.cell_data["turned"] = np.isin(one["mesh"].facet_ids, one["map"].folded_facets).astype(float)
        plotter = pyvista.Plotter(off_screen=True, window_size=(880, 760))
        plotter.set_background("white")
        colors = ["#a9b4bf", "#d3202f"]
        plotter.add_mesh(data, scalars="turned", cmap=colors, clim=(0, 1), show_scalar_bar=False, ambient=0.15)
        plotter.view_vector(view, up)
        plotter.camera.zoom(1.15)
        plotter.enable_anti_aliasing("ssaa")
        panel.imshow(plotter.screenshot(None, return_img=True))
        plotter.close()
        panel.axis("off")
        share = one["best"].violation_bounds[1]
        panel.set_title(f"{name}\n{100 * share:.2g} % turned away", fontsize=12)
        for which, color in (("rms", "#2f6db5"), ("hausdorff", "#c85a00")):
            values = [100 * getattr(one["errors"][degree], which) / one["size"] for degree in degrees]
            curve.loglog(degrees, values, "o-", color=color, label={"rms": "rms", "hausdorff": "largest"}[which])
            curve.axhline(100 * getattr(one["errors"]["radius grid"], which) / one["size"], color=color, ls=":", lw=1)
        curve.set(xlabel="degree", ylim=(0.008, 30), xticks=degrees, xticklabels=degrees)
        curve.minorticks_off()
        curve.grid(alpha=0.3)
    axes[1, 0].set_ylabel("distance, % of the diagonal")
    axes[1, 0].legend(frameon=False)
    chart.savefig(path, dpi=110)
    plt.close(chart)


draw(found, "bodies.png")

# %%
# Real ones
# ---------
folder = Path(os.environ.get("VOXKERNEL_DATA", "")) / "asteroids"
names = {"Bennu": "bennu", "Eros": "eros", "67P": "churyumov-gerasimenko"}
if all((folder / f"{file}.ply").exists() for file in names.values()):
    real = {name: judge(name, voxkernel.as_mesh(folder / f"{file}.ply")) for name, file in names.items()}
    draw(real, "real_bodies.png", view=(0.5, -1.0, 0.5))
else:
    print("VOXKERNEL_DATA names no folder with asteroids: only the bodies by formula are shown")

# %%
# Limits
# ------
# The verdict is about the mesh as given: a coarser model of the same body can have a kernel where a finer one has
# none. The error of a reconstruction is measured both ways between surfaces, so what a grid cannot reach counts once
# as a hole and once as a lid over it.
#
# Source of the map: N. Werghi, 2008, section IV.A; of the spectrum: M. Kazhdan and others, 2003. See
# :doc:`/references`.
