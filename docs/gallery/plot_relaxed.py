"""
The relaxed kernel grows with alpha
===================================

No point sees all of a body with two lobes: its kernel is empty. The relaxed kernel holds the points that at most a
share alpha of the area is turned away from. It appears at the smallest violation there is and grows from there.
"""

import matplotlib.pyplot as plt
import pyvista

import voxkernel
from voxkernel.demo_shapes import comet
from voxkernel.pictures import level_surface

mesh = comet()
print(voxkernel.exact_kernel(mesh))
best = voxkernel.best_center(mesh)
low, high = best.violation_bounds
print(f"at the best point {100 * low:.2f} to {100 * high:.2f} % of the area is turned away")

# %%
# The call
# --------
# All tolerances are found in one traversal of the octree. Every grid contains the one before.
shares = [high + extra for extra in (0.03, 0.06, 0.1, 0.15, 0.2)]
grids = voxkernel.voxel_kernels(mesh, tolerances=shares, depth=8)
for grid in grids:
    print(grid)
profile = voxkernel.defect_profile(mesh, depth=6)

# %%
# The picture
# -----------
# The surfaces on which the violation reaches alpha, contoured on a grid; certain are the voxels of each grid.
views = []
for grid in grids:
    plotter = pyvista.Plotter(off_screen=True, window_size=(760, 620))
    plotter.set_background("white")
    plotter.add_mesh(mesh.to_polydata(), color="#7fb0e6", opacity=0.28, smooth_shading=True)
    level = pyvista.PolyData.from_regular_faces(*level_surface(mesh, grid))
    plotter.add_mesh(level, color="#a34a9c", smooth_shading=True, ambient=0.3, specular=0.2)
    plotter.view_vector((0.25, -0.5, 1.0), (0, 1, 0))
    plotter.camera.zoom(1.35)
    plotter.enable_anti_aliasing("ssaa")
    views.append(plotter.screenshot(None, return_img=True))
    plotter.close()

chart, axes = plt.subplots(2, 3, figsize=(13, 7), layout="constrained")
for panel, grid, view in zip(axes.flat, grids, views, strict=False):
    panel.imshow(view)
    panel.set_title(f"alpha = {grid.tolerance:.3f}", fontsize=12)
    panel.axis("off")
last = axes[1, 2]
lower, upper = profile.volume_share_bounds.T
last.fill_between(profile.tolerances, lower, upper, color="#a34a9c", alpha=0.5)
last.axvline(high, color="0.5", lw=0.8, ls="--")
last.set(xlabel="alpha", title="volume, share of the hull (certain bounds)", xlim=(0, 0.5), ylim=(0, 1))
last.grid(alpha=0.3)
chart.savefig("relaxed.png", dpi=110)
plt.close(chart)

# %%
# Limits
# ------
# The relaxed kernel is about facing, not seeing: the hidden part of a surface is at least the part turned away, and
# can be more (:doc:`/theory/relaxed`). It is not convex. It could leak out of a closed body, so it is looked for in
# the convex hull; see :doc:`plot_domains`. How to choose alpha: :doc:`/howto/alpha_and_depth`.
#
# Source of the exact kernel: N. Werghi, 2008; the relaxed one is ours. See :doc:`/references`.
