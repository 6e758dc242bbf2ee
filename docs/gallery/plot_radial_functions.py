"""
Radial functions and reconstructions
====================================

Seen from a kernel point, a surface is a radius for every direction. Above: that radius on the sphere, for three
surfaces made by formula. Below: the surface rebuilt from the radii alone (Werghi 2008, figure 3).
"""

import numpy as np
import pyvista

import voxkernel
from voxkernel.demo_shapes import face, star_prism, urchin

surfaces = {"face": face(), "star prism": star_prism(), "urchin": urchin(subdivisions=5)}

# %%
# The call
# --------
# `spherical_map` chooses the centre. Of a closed surface every kernel point sees all, and the deepest one is taken;
# of an open one the point that sees it under the largest solid angle (:doc:`/theory/coverage`), here kept a little
# away from the facet planes. `sample` casts a ray along every direction of a grid, `reconstruct` joins the ends.
maps = {name: voxkernel.spherical_map(mesh, clearance=0.05) for name, mesh in surfaces.items()}
samples = {name: seen.sample(n=150) for name, seen in maps.items()}
rebuilt = {name: grid.reconstruct() for name, grid in samples.items()}
for name, seen in maps.items():
    error = seen.error(rebuilt[name])
    size = surfaces[name].facts().diagonal
    print(f"{name}: {seen}, reconstruction rms {100 * error.rms / size:.3f} % of the diagonal")

# %%
# The picture
# -----------
views = {"face": (0.75, -0.1, 1.0), "star prism": (0.3, -0.9, 1.0), "urchin": (0.6, -0.7, 0.5)}
ups = {"face": (0, 1, 0), "star prism": (0, 1, 0), "urchin": (0, 0, 1)}
plotter = pyvista.Plotter(off_screen=True, shape=(2, 3), window_size=(1500, 1000), border=False)
plotter.set_background("white", all_renderers=True)
for column, name in enumerate(surfaces):
    seen, grid = maps[name], samples[name]
    directions = grid.grid.directions().reshape(150, 300, 3)
    closed = np.concatenate([directions, directions[:, :1]], axis=1)
    radii = np.concatenate([grid.radii, grid.radii[:, :1]], axis=1)
    ball = pyvista.StructuredGrid(*np.moveaxis(closed, -1, 0))
    ball.point_data["radius"] = radii.ravel(order="F")
    plotter.subplot(0, column)
    plotter.add_mesh(ball, scalars="radius", cmap="viridis", nan_color="#e3e7ec", show_scalar_bar=False, ambient=0.4)
    plotter.add_text(f"{name}: {100 * seen.coverage:.0f} % covered", font_size=13, color="#1d2733")
    plotter.view_vector(views[name], ups[name])
    plotter.camera.zoom(1.25)
    plotter.enable_anti_aliasing("ssaa")
    plotter.subplot(1, column)
    body = rebuilt[name].to_polydata()
    plotter.add_mesh(body, color="#7fb0e6", smooth_shading=True, split_sharp_edges=True, ambient=0.3)
    plotter.view_vector(views[name], ups[name])
    plotter.camera.zoom(1.25)
    plotter.enable_anti_aliasing("ssaa")
plotter.screenshot("radial_functions.png")
plotter.close()

# %%
# Limits
# ------
# Only a star-shaped surface is a function on the sphere. For others `center="relaxed"` takes the point that faces the
# most; `folded_facets` and `hidden_fraction` then say what the radius cannot hold.
#
# Source: N. Werghi, "The Discrete Surface Kernel: Framework and Applications", 2008, section IV.A and figure 3.
