"""
Samples of kernels
==================

Six faces made by formula and their kernels, as in Werghi (2008, figure 2). The surfaces are open, so their kernels
have no end on one side; they are shown inside the ball they are looked for in. The more a nose hangs over, the less
is left.
"""

import numpy as np
import pyvista

import voxkernel
from voxkernel.demo_shapes import face


def variant(hook, cheeks, chin):
    """A face with a hanging nose, fuller cheeks and a longer chin."""
    mesh = face(hook=hook)
    points = mesh.vertices.copy()
    front = np.array([0.0, -0.25, 0.95])
    for at, amount in (((0.45, -0.25), cheeks), ((-0.45, -0.25), cheeks), ((0.0, -0.85), chin)):
        near = np.exp(-(((points[:, 0] - at[0]) / 0.22) ** 2) - ((points[:, 1] - at[1]) / 0.2) ** 2)
        points += amount * near[:, None] * front
    return voxkernel.as_mesh((points, mesh.faces))


# %%
# Kernels
# -------
recipes = [(0, 0, 0), (0.06, 0, 0.05), (0.12, 0.05, 0), (0.18, 0.08, 0.08), (0.24, 0, 0.1), (0.34, 0, 0)]
faces = [variant(*recipe) for recipe in recipes]
kernels = [voxkernel.exact_kernel(mesh) for mesh in faces]
for recipe, kernel in zip(recipes, kernels, strict=True):
    print(f"hook {recipe[0]:.2f}: {100 * kernel.volume / kernel.domain.volume:6.2f} % of the ball, {kernel}")

# %%
# The picture
# -----------
plotter = pyvista.Plotter(off_screen=True, shape=(2, 3), window_size=(1800, 1100), border=False)
plotter.set_background("white", all_renderers=True)
for i, (mesh, kernel) in enumerate(zip(faces, kernels, strict=True)):
    plotter.subplot(i // 3, i % 3)
    plotter.add_mesh(mesh.to_polydata(), color="#7fb0e6", smooth_shading=True, specular=0.3, opacity=0.6)
    share = kernel.volume / kernel.domain.volume
    text = f"{100 * share:.2g} % of the ball" if not kernel.is_empty else "empty"
    if not kernel.is_empty:
        solid = kernel.to_mesh().to_polydata()
        plotter.add_mesh(solid, color="#ff7a14", ambient=0.3, specular=0.2)
    plotter.add_text(text, font_size=15, color="#1d2733", position="upper_left")
    plotter.camera_position = [(6.2, -3.4, 2.6), (-0.1, 0.05, -0.25), (0.0, 1.0, 0.0)]
    plotter.camera.zoom(1.45)
    plotter.enable_anti_aliasing("ssaa")
plotter.screenshot("samples.png")
plotter.close()

# %%
# Limits
# ------
# Real faces are less kind: at full resolution the kernels of scans are usually empty, because of a few facets. See
# :doc:`/howto/noisy_scans` for what to do then.
#
# Source: N. Werghi, "The Discrete Surface Kernel: Framework and Applications", 2008, figure 2.
