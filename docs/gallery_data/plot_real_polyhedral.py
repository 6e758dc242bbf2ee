"""
Cells of a polyhedral mesh
==========================

Polyhedra joined from tetrahedra, each a cell of a mesh, moved apart and coloured by the share of the volume that the
kernel fills.
"""

import os
from pathlib import Path

import numpy as np
import pyvista

from voxkernel.polyhedral import cell_kernels, read_polyhedral

data = Path(os.environ["VOXKERNEL_DATA"])
mesh = read_polyhedral(data / "polyhedral" / "sorgente_tet20_cells")

# %%
# The call
# --------
kernels = cell_kernels(mesh)
print(kernels)
print("shares, quartiles:", np.quantile(kernels.volume_share, [0, 0.25, 0.5, 0.75, 1]).round(3))

# %%
# The picture
# -----------
plotter = pyvista.Plotter(off_screen=True, window_size=(1300, 900))
plotter.set_background("white")
middle = mesh.vertices.mean(axis=0)
for i, share in enumerate(kernels.volume_share):
    cell = mesh.cell(i)
    data_set = cell.to_polydata()
    data_set.points += 3.0 * (cell.vertices[np.unique(cell.faces)].mean(axis=0) - middle)
    data_set.cell_data["kernel share"] = np.full(data_set.n_cells, share)
    plotter.add_mesh(data_set, scalars="kernel share", cmap="viridis", clim=(0, 0.5), ambient=0.25,
                     scalar_bar_args={"color": "black", "vertical": True, "fmt": "%.1f"})  # fmt: skip
    plotter.add_mesh(data_set.extract_feature_edges(1), color="#26323d", line_width=1)
plotter.view_vector((0.6, -0.8, 0.5), (0, 0, 1))
plotter.camera.zoom(1.3)
plotter.enable_anti_aliasing("ssaa")
plotter.screenshot("real_polyhedral.png")
plotter.close()

# %%
# Limits
# ------
# 100 cells; the files are those of T. Sorgente and others (AGPL-3.0 repository), used as test inputs only.
# :doc:`/made/gallery/plot_polyhedral` is a mesh by formula.
#
# Source: T. Sorgente and others, 2022; see :doc:`/references`.
