"""
Radial functions of real shapes
===============================

A smoothed face scan, a small model of the asteroid Bennu, and the asteroid Castalia, seen from a kernel point: the
radius per direction above, the surface rebuilt from the radii alone below (Werghi 2008, figure 3).
"""

import os
from pathlib import Path

import numpy as np
import pyvista

import voxkernel

data = Path(os.environ["VOXKERNEL_DATA"])
files = {
    "face": data / "faces_smooth" / "smooth_ict01_neutral.ply",
    "Bennu": data / "asteroids" / "bennu_lp.ply",
    "Castalia": data / "asteroids" / "castalia.ply",
}
surfaces = {name: voxkernel.as_mesh(file) for name, file in files.items()}

# %%
# The call
# --------
samples, rebuilt, covered = {}, {}, {}
for name, mesh in surfaces.items():
    size = mesh.facts().diagonal
    seen = voxkernel.spherical_map(mesh, clearance=0.02 * size)
    samples[name], covered[name] = seen.sample(n=150), seen.coverage
    rebuilt[name] = samples[name].reconstruct()
    error = seen.error(rebuilt[name])
    print(f"{name}, {mesh.n_facets} facets: coverage {seen.coverage:.3f}, rms {100 * error.rms / size:.3f} %, "
          f"largest {100 * error.hausdorff / size:.2f} % of the diagonal")  # fmt: skip

# %%
# The picture
# -----------
plotter = pyvista.Plotter(off_screen=True, shape=(2, 3), window_size=(1500, 1000), border=False)
plotter.set_background("white", all_renderers=True)
for column, (name, grid) in enumerate(samples.items()):
    view, up = ((0.75, 0.1, 1.0), (0, 1, 0)) if name == "face" else ((0.5, -1.0, 0.5), (0, 0, 1))
    directions = grid.grid.directions().reshape(150, 300, 3)
    closed = np.concatenate([directions, directions[:, :1]], axis=1)
    ball = pyvista.StructuredGrid(*np.moveaxis(closed, -1, 0))
    ball.point_data["radius"] = np.concatenate([grid.radii, grid.radii[:, :1]], axis=1).ravel(order="F")
    plotter.subplot(0, column)
    plotter.add_mesh(ball, scalars="radius", cmap="viridis", nan_color="#e3e7ec", show_scalar_bar=False, ambient=0.4)
    plotter.add_text(f"{name}: {100 * covered[name]:.0f} % covered", font_size=13, color="#1d2733")
    plotter.view_vector(view, up)
    plotter.camera.zoom(1.25)
    plotter.enable_anti_aliasing("ssaa")
    plotter.subplot(1, column)
    plotter.add_mesh(rebuilt[name].to_polydata(), color="#7fb0e6", smooth_shading=name == "face", ambient=0.3)
    plotter.view_vector(view, up)
    plotter.camera.zoom(1.25)
    plotter.enable_anti_aliasing("ssaa")
plotter.screenshot("real_radial_functions.png")
plotter.close()

# %%
# Limits
# ------
# Bodies that are star-shaped were chosen, and a face that was smoothed until it is. For those that are not:
# :doc:`/made/gallery/plot_bodies`.
#
# Source: N. Werghi, 2008, section IV.A and figure 3; see :doc:`/references`.
