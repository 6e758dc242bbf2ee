"""
Surface, grid and kernel
========================

The kernel of a surface is the set of points from which all of it can be seen. Werghi (2008, figure 1) lays a grid of
points around a face and strikes out, facet after facet, the points on the outer side of its plane. What is left is
the discrete kernel.
"""

import numpy as np
import pyvista

import voxkernel
from voxkernel.demo_shapes import face
from voxkernel.halfspaces import ball_domain

mesh = voxkernel.as_mesh(face())

# %%
# The paper's sweep
# -----------------
# A grid of points in a ball around the surface. Every facet keeps the points on its inner side.
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
print(f"{len(grid)} points, {len(normals)} facets, {len(left)} points left")

# %%
# The same from the library
# -------------------------
# `exact_kernel` gives the polytope that the points sample, `voxel_kernel` a sparse grid of it. No point is judged
# differently; the "undecided" ones lie in voxels that the boundary crosses.
kernel = voxkernel.exact_kernel(mesh)
voxels = voxkernel.voxel_kernel(mesh, depth=8)
swept, struck = voxels.classify(left), voxels.classify(grid)
print(kernel)
print(f"left by the sweep: {np.sum(swept == 1)} inside, {np.sum(swept == 0)} undecided, {np.sum(swept == -1)} outside")
assert np.sum(struck == 1) == np.sum(swept == 1)

# %%
# The picture
# -----------
surface = mesh.to_polydata()
plotter = pyvista.Plotter(off_screen=True, shape=(1, 3), window_size=(1800, 660), border=False)
plotter.set_background("white", all_renderers=True)
words = ("the surface", f"{len(grid):,} grid points", f"the {len(left)} that see all of it")
for column, points in enumerate([None, grid, left]):
    plotter.subplot(0, column)
    plotter.add_mesh(surface, color="#7fb0e6", smooth_shading=True, ambient=0.2, opacity=1.0 if column < 2 else 0.5)
    if column == 1:
        plotter.add_points(points, color="#2f4460", point_size=4, opacity=0.45)
    if column == 2:
        solid = kernel.to_mesh().to_polydata()
        plotter.add_mesh(solid, color="#ff7a14", opacity=0.12)
        plotter.add_points(points, color="#e8650a", point_size=11, render_points_as_spheres=True)
    plotter.add_text(words[column], font_size=15, color="#1d2733", position="upper_left")
    plotter.camera_position = [(5.2, 1.9, 3.3), ball.vertices.mean(axis=0), (0.0, 1.0, 0.0)]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = 1.65
    plotter.enable_anti_aliasing("ssaa")
plotter.screenshot("surface_grid_kernel.png")
plotter.close()

# %%
# Limits
# ------
# The sweep visits every facet with every point that is left, and its answer is as fine as its grid; it cannot tell an
# empty kernel from one that fell between the points. The polytope and its certificate can. See
# :doc:`/theory/octree_cost` for what each costs and :doc:`/theory/half_spaces` for why the half-spaces are enough.
#
# Source: N. Werghi, "The Discrete Surface Kernel: Framework and Applications", 2008, section II and figure 1.
