"""
Relaxed kernels of a real scan
==============================

A noisy, cropped scan of a face: no point sees all of it. Its relaxed kernels grow with alpha, the share of the area
that may be turned away.
"""

import os
from pathlib import Path

import numpy as np
import pyvista

import voxkernel
from voxkernel.pictures import level_surface

data = Path(os.environ["VOXKERNEL_DATA"])
mesh = voxkernel.as_mesh(data / "scans" / "scan_ict01_neutral.ply")

# %%
# The calls
# ---------
print(voxkernel.exact_kernel(mesh).certificate)
best = voxkernel.best_center(mesh)
low, high = best.violation_bounds
print(f"at the best point {100 * low:.2f} to {100 * high:.2f} % of the area is turned away")
shares = [high + extra for extra in (0.005, 0.02, 0.06)]
grids = voxkernel.voxel_kernels(mesh, tolerances=shares, depth=8)
for grid in grids:
    print(grid)

# %%
# The picture
# -----------
ahead = mesh.facet_areas @ mesh.facet_normals
ahead /= np.linalg.norm(ahead)
flat = mesh.vertices - mesh.vertices.mean(axis=0)
flat = flat - np.outer(flat @ ahead, ahead)
up = -np.linalg.svd(flat, full_matrices=False)[2][0]  # the longest axis across the view; of this scan it points down
plotter = pyvista.Plotter(off_screen=True, shape=(1, 3), window_size=(1800, 700), border=False)
plotter.set_background("white", all_renderers=True)
for column, grid in enumerate(grids):
    plotter.subplot(0, column)
    plotter.add_mesh(mesh.to_polydata(), color="#7fb0e6", opacity=0.7, ambient=0.2)
    level = pyvista.PolyData.from_regular_faces(*level_surface(mesh, grid))
    plotter.add_mesh(level, color="#a34a9c", smooth_shading=True, ambient=0.3)
    plotter.add_text(f"alpha = {grid.tolerance:.3f}", font_size=15, color="#1d2733")
    plotter.view_vector(0.45 * ahead + 0.88 * np.cross(up, ahead), up)
    plotter.camera.zoom(1.35)
    plotter.enable_anti_aliasing("ssaa")
plotter.screenshot("real_relaxed.png")
plotter.close()

# %%
# Limits
# ------
# A virtual scan, made from a face of ICT-FaceKit (MIT). Points of a relaxed kernel face most of the surface; what they
# see is :doc:`another question </theory/relaxed>`.
#
# Source of the exact kernel: N. Werghi, 2008; the relaxed one is ours. See :doc:`/references`.
