"""
Kernels at depths 4 to 10
=========================

Every level of depth halves the voxels. What is certainly inside grows, what is undecided becomes a thinner skin, and
the true volume always lies between the two counts.
"""

import matplotlib.pyplot as plt
import numpy as np
import pyvista

import voxkernel
from voxkernel.demo_shapes import star_prism

mesh = star_prism(points=7, inner=0.55, height=0.8)
kernel = voxkernel.exact_kernel(mesh)

# %%
# The call
# --------
# Inside voxels lie wholly in the kernel; inside and undecided voxels together cover it.
depths = range(4, 11)
grids = {depth: voxkernel.voxel_kernel(mesh, depth=depth) for depth in depths}
print(f"exact volume {kernel.volume:.9f}")
for depth, grid in grids.items():
    low, high = grid.volume_bounds
    assert low <= kernel.volume <= high
    undecided = grid.boundary.active_voxel_count
    print(f"depth {depth}: {low:.6f} to {high:.6f}, {undecided} undecided voxels, {grid.nbytes / 1e3:.0f} kB")

# %%
# The picture
# -----------
# Inside voxels at each depth; the last panel shows how far the bounds are from the exact volume.
views = []
for depth, grid in grids.items():
    plotter = pyvista.Plotter(off_screen=True, window_size=(700, 620))
    plotter.set_background("white")
    glass = mesh.to_polydata()
    plotter.add_mesh(glass, color="#7fb0e6", opacity=0.18)
    plotter.add_mesh(glass.extract_feature_edges(30), color="#2f4460", line_width=2)
    if grid.active_voxel_count:
        solid = grid.to_mesh().to_polydata()
        plotter.add_mesh(solid, color="#ff7a14", show_edges=depth < 8, edge_color="#a34a00", ambient=0.3)
    plotter.view_vector((0.45, -0.85, 1.0), (0, 0, 1))
    plotter.camera.zoom(1.2)
    plotter.enable_anti_aliasing("ssaa")
    views.append(plotter.screenshot(None, return_img=True))
    plotter.close()

chart, axes = plt.subplots(2, 4, figsize=(14, 6.6), layout="constrained")
for panel, depth, view in zip(axes.flat, depths, views, strict=False):
    panel.imshow(view)
    panel.set_title(f"depth {depth}: {grids[depth].active_voxel_count:,} voxels", fontsize=11)
    panel.axis("off")
bounds = np.array([grids[depth].volume_bounds for depth in depths]) / kernel.volume
last = axes[1, 3]
last.semilogy(list(depths), 1 - bounds[:, 0], "v-", color="#c85a00", label="missing from inside")
last.semilogy(list(depths), bounds[:, 1] - 1, "^-", color="#2f6db5", label="too much with undecided")
last.semilogy(list(depths), np.abs(bounds.mean(axis=1) - 1), "o:", color="0.5", label="middle of the bounds")
last.set(xlabel="depth", title="share of the exact volume")
last.legend(fontsize=8, frameon=False)
last.grid(alpha=0.3)
chart.savefig("depths.png", dpi=110)
plt.close(chart)

# %%
# Limits
# ------
# The bounds halve with each level, and the number of cells grows by a factor of 4: :doc:`/theory/octree_cost`,
# :doc:`/theory/volume_bounds`. ``rtol=0.01`` picks the depth for you. A grid of depth 10 is stored as tiles and 8^3
# bricks, in OpenVDB's layout.
#
# Sources: N. Werghi, 2008, for the grid of points that this refines; K. Museth, 2013, for the layout. See
# :doc:`/references`.
