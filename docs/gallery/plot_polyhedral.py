"""
A polyhedral mesh coloured by kernel share
==========================================

In a mesh of polyhedral cells the kernel of each cell says how good it is: numerical methods ask for cells that are
star-shaped about a ball of some size. Here a block of hexahedra is warped more and more towards one end; the
colour is the share of each cell's volume that its kernel fills.
"""

import matplotlib.pyplot as plt
import numpy as np
import pyvista

from voxkernel.polyhedral import PolyhedralMesh, cell_kernels

# %%
# A mesh by formula
# -----------------
# Faces are shared, as in a file. A warped quadrilateral is not planar: it counts as its two triangles.
shape = (28, 12, 12)
ijk = np.stack(np.meshgrid(*(np.arange(n + 1) for n in shape), indexing="ij"), axis=-1)
points = ijk / 12.0 - [0.0, 0.5, 0.5]
reach = np.clip(points[..., 0] / 2.4, 0, 1)
ripple = 0.12 * reach**2
for axis, (a, b) in enumerate([(1, 2), (2, 0), (0, 1)]):
    points[..., axis] += ripple * np.sin(11.0 * ijk[..., a] + 2.3 * axis) * np.cos(7.0 * ijk[..., b] + axis)
number = np.arange(points[..., 0].size).reshape(points.shape[:3])

faces, face_of = [], {}


def face(*corners):
    """Number a face, once for both of its cells."""
    key = tuple(sorted(corners))
    if key not in face_of:
        face_of[key] = len(faces)
        faces.append(list(corners))
    return face_of[key]


cells, corners_of = [], []
for i, j, k in np.ndindex(*shape):
    c = number[i : i + 2, j : j + 2, k : k + 2].ravel().tolist()  # bits of the position: x, y, z
    rings = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    cells.append([face(*(c[n] for n in ring)) for ring in rings])
    corners_of.append([c[n] for n in (0, 4, 6, 2, 1, 5, 7, 3)])
mesh = PolyhedralMesh.from_faces(points.reshape(-1, 3), faces, cells)

# %%
# The call
# --------
# One row per cell: dimension, volumes, the largest ball, and why a cell could not be judged if so.
kernels = cell_kernels(mesh)
share = np.nan_to_num(kernels.volume_share)
print(kernels)
print("why not judged:", {reason.split(":")[0] for reason in kernels.reasons if reason})
print("shares of the volume, quartiles:", np.quantile(share, [0, 0.25, 0.5, 0.75, 1]).round(3))

# %%
# The picture
# -----------
grid = pyvista.UnstructuredGrid({pyvista.CellType.HEXAHEDRON: np.array(corners_of)}, points.reshape(-1, 3))
grid.cell_data["share"] = share
grid.cell_data["state"] = np.where(kernels.is_failed, 2, np.where(kernels.is_star_shaped, 0, 1))
middle = grid.cell_centers().points
grid = grid.extract_cells((middle[:, 1] < 0.0) | (middle[:, 2] < 0.0))

plotter = pyvista.Plotter(off_screen=True, window_size=(1300, 760))
plotter.set_background("white")
plotter.add_mesh(grid, scalars="share", cmap="viridis", clim=(0, 1), show_edges=True, edge_color="#33414f",
                 line_width=1, show_scalar_bar=False, ambient=0.25)  # fmt: skip
for state, color in ((1, "#d3202f"), (2, "#1d2733")):
    some = grid.extract_cells(np.flatnonzero(grid.cell_data["state"] == state))
    if some.n_cells:
        plotter.add_mesh(some, color=color, show_edges=True, ambient=0.3)
plotter.view_vector((-0.35, 0.8, 0.75), (0, 0, 1))
plotter.camera.zoom(1.3)
plotter.enable_anti_aliasing("ssaa")
image = plotter.screenshot(None, return_img=True)
plotter.close()

chart, (left, right) = plt.subplots(1, 2, figsize=(13, 4.8), layout="constrained", width_ratios=(2.3, 1))
left.imshow(image)
left.axis("off")
n_inside_out, n_not = np.sum(kernels.is_failed), np.sum(~kernels.is_star_shaped & ~kernels.is_failed)
words = f"red: {n_not} not star-shaped, black: {n_inside_out} inside out"
left.set_title(f"{len(mesh)} cells, one quarter cut away; {words}")
right.hist(share, bins=40, range=(0, 1), color="#3b6fa0")
right.set(xlabel="kernel volume / cell volume", ylabel="cells", xlim=(0, 1))
bar = chart.colorbar(plt.cm.ScalarMappable(cmap="viridis"), ax=left, orientation="horizontal", shrink=0.5, pad=0.02)
bar.set_label("share")
chart.savefig("polyhedral.png", dpi=110)
plt.close(chart)

# %%
# Limits
# ------
# A hexahedron with a warped face has two triangulations of it, and they have two kernels; the one used follows the
# corner the face starts with. ``.hedra``, ``.mesh``, ``.vtu`` and folders of cells are read by
# ``read_polyhedral``.
#
# Source of the quality measure: T. Sorgente and others, 2022; see :doc:`/references`.
