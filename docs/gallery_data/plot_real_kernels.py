"""
Kernels of real faces
=====================

Six face scans that were smoothed until they have a kernel, and their kernels (Werghi 2008, figure 2). Unsmoothed, none
of them has one.
"""

import os
from pathlib import Path

import numpy as np
import pyvista

import voxkernel

data = Path(os.environ["VOXKERNEL_DATA"])
names = ["real_leeperrysmith_face", *(f"smooth_ict{n:02d}_neutral" for n in (1, 2, 3, 5, 6))]
faces = [voxkernel.as_mesh(data / "faces_smooth" / f"{name}.ply") for name in names]

# %%
# The calls
# ---------
kernels = [voxkernel.exact_kernel(mesh) for mesh in faces]
for name, kernel in zip(names, kernels, strict=True):
    print(f"{name}: {100 * kernel.volume / kernel.domain.volume:.3f} % of the ball, {kernel}")
for path in sorted((data / "scans").glob("*.ply")):
    score = voxkernel.starshapeness(path)
    print(f"{path.stem}: {score.verdict}, {100 * score.violation_bounds[1]:.2f} % of the area in the way")

# %%
# The picture
# -----------
plotter = pyvista.Plotter(off_screen=True, shape=(2, 3), window_size=(1800, 1160), border=False)
plotter.set_background("white", all_renderers=True)
for i, (mesh, kernel) in enumerate(zip(faces, kernels, strict=True)):
    plotter.subplot(i // 3, i % 3)
    ahead = mesh.facet_areas @ mesh.facet_normals
    ahead /= np.linalg.norm(ahead)
    # The longest axis of a face that is not its viewing direction is upright, up to its sign.
    flat = mesh.vertices - mesh.vertices.mean(axis=0)
    flat = flat - np.outer(flat @ ahead, ahead)
    up = np.linalg.svd(flat, full_matrices=False)[2][0]
    plotter.add_mesh(mesh.to_polydata(), color="#7fb0e6", smooth_shading=True, opacity=0.6, ambient=0.15)
    plotter.add_mesh(kernel.to_mesh().to_polydata(), color="#ff7a14", ambient=0.3)
    plotter.add_text(f"{100 * kernel.volume / kernel.domain.volume:.2g} % of the ball", font_size=14, color="#1d2733")
    plotter.view_vector(0.55 * ahead + 0.83 * np.cross(up, ahead), up)
    plotter.camera.zoom(1.3)
    plotter.enable_anti_aliasing("ssaa")
plotter.screenshot("real_kernels.png")
plotter.close()

# %%
# Limits
# ------
# The settings of the smoothing were chosen so that a kernel exists: this says nothing about how often one does. Model
# faces and virtual scans by ICT-FaceKit (MIT), one real head by Lee Perry-Smith (CC BY 3.0).
#
# Source: N. Werghi, 2008, figure 2; see :doc:`/references`.
