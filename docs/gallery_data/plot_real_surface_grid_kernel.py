"""
Surface, grid and kernel of a real face
=======================================

A face scan that was smoothed until it has a kernel, the grid of points around it, and the points that see all of it
(Werghi 2008, figure 1).
"""

import os
from pathlib import Path

import numpy as np
import pyvista

import voxkernel
from voxkernel.halfspaces import ball_domain

data = Path(os.environ["VOXKERNEL_DATA"])
mesh = voxkernel.as_mesh(data / "faces_smooth" / "smooth_ict01_neutral.ply")

# %%
# The sweep and the polytope
# --------------------------
ball = ball_domain(mesh)
low, high = ball.vertices.min(axis=0), ball.vertices.max(axis=0)
steps = [np.linspace(low[k], high[k], 21) for k in range(3)]
grid = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
grid = grid[(grid @ ball.normals.T <= ball.offsets).all(axis=1)]

a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
normals = np.cross(b - a, c - a)
offsets = np.einsum("ij,ij->i", normals, a)
left = grid
for normal, offset in zip(normals, offsets, strict=True):
    left = left[left @ normal <= offset]
kernel = voxkernel.exact_kernel(mesh)
print(f"{len(grid)} points, {len(normals)} facets, {len(left)} points left")
print(kernel)
inside = voxkernel.voxel_kernel(mesh, depth=8).classify(left)
print(f"in the voxel grid: {np.sum(inside == 1)} inside, {np.sum(inside == 0)} undecided, {np.sum(inside < 0)} outside")
assert (inside >= 0).all()

# %%
# The picture
# -----------
ahead = normals.sum(axis=0) / np.linalg.norm(normals.sum(axis=0))
up = np.array([0.0, 1.0, 0.0])
words = ("the surface", f"{len(grid):,} grid points", f"the {len(left)} that see all of it")
plotter = pyvista.Plotter(off_screen=True, shape=(1, 3), window_size=(1800, 660), border=False)
plotter.set_background("white", all_renderers=True)
for column, points in enumerate([None, grid, left]):
    plotter.subplot(0, column)
    opacity = 1.0 if column < 2 else 0.5
    plotter.add_mesh(mesh.to_polydata(), color="#7fb0e6", smooth_shading=True, ambient=0.2, opacity=opacity)
    if column == 1:
        plotter.add_points(points, color="#2f4460", point_size=4, opacity=0.45)
    if column == 2:
        plotter.add_mesh(kernel.to_mesh().to_polydata(), color="#ff7a14", opacity=0.12)
        plotter.add_points(points, color="#e8650a", point_size=11, render_points_as_spheres=True)
    plotter.add_text(words[column], font_size=15, color="#1d2733", position="upper_left")
    middle, radius = ball.vertices.mean(axis=0), np.ptp(ball.vertices, axis=0).max() / 2
    plotter.camera_position = [middle + 4 * radius * (0.5 * ahead + 0.8 * np.cross(up, ahead) + 0.2 * up), middle, up]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = 1.05 * radius
    plotter.enable_anti_aliasing("ssaa")
plotter.screenshot("real_surface_grid_kernel.png")
plotter.close()

# %%
# Limits
# ------
# One face, made with ICT-FaceKit (MIT) and smoothed; the scan it was made from has no kernel.
#
# Source: N. Werghi, 2008, section II and figure 1; see :doc:`/references`.
