"""
A .vdb file as a volume
=======================

How much of a surface is turned away from a point, around its kernel: the violation field of an urchin goes to a .vdb
file, comes back, and is drawn as a volume. Any program that reads OpenVDB draws the same file.
"""

import tempfile
from pathlib import Path

import numpy as np
import pyvista

import voxkernel
from voxkernel.demo_shapes import urchin
from voxkernel.grid import to_pyvista_image, to_surface

# %%
# The file
# --------
# Voxels with a value of at most `hidden` are active: from them at most that share of the surface, by area, is
# turned away. Where the value is 0 none is: that is the kernel, the second grid of the file.
hidden = 0.2
mesh = urchin()
field = voxkernel.violation_grid(mesh, depth=7, tolerance=hidden)
kernel = voxkernel.voxel_kernel(mesh, depth=8)
path = Path(tempfile.mkdtemp()) / "urchin.vdb"
voxkernel.write_vdb(path, {"violation": field, "inside": kernel.inside}, metadata={"source": "urchin", "alpha": hidden})

file = voxkernel.read_vdb(path)
print(f"{path.stat().st_size / 1e6:.1f} MB, {file.metadata}")
for grid in file:
    print(grid)

# %%
# The picture
# -----------
# The field is opaque where little is hidden and fades out towards `hidden`; an eighth of it is cut away. The kernel
# is the body in the middle, drawn voxel by voxel, the urchin the glass around it.
name = "share of the surface turned away"
image = to_pyvista_image(file["violation"])
centres = image.cell_centers().points
is_cut = (centres[:, 0] > 0) & (centres[:, 1] < 0) & (centres[:, 2] > 0)
image.cell_data[name] = np.where(is_cut, hidden, np.minimum(image.cell_data.pop("value"), hidden))

plotter = pyvista.Plotter(off_screen=True, window_size=(1200, 1050))
plotter.set_background("white")
plotter.add_volume(
    image.cell_data_to_point_data(),
    scalars=name,
    cmap="viridis",
    clim=(0.0, hidden),
    opacity=[1.0, 0.7, 0.4, 0.2, 0.08, 0.0],
    opacity_unit_distance=0.05,
    show_scalar_bar=False,
)
solid = pyvista.PolyData.from_regular_faces(*to_surface(file["inside"]))
plotter.add_mesh(solid, color="#ff6b3d", ambient=0.4, specular=0.2)
glass = pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
plotter.add_mesh(glass, color="#6f8ba5", opacity=0.18, smooth_shading=True)
scale = pyvista.LookupTable("viridis", scalar_range=(0.0, hidden))  # opaque, unlike the volume's own
bar = plotter.add_scalar_bar(
    name + "\n", mapper=None, color="black", n_labels=5, fmt="%.2f", title_font_size=24, label_font_size=20,
    position_x=0.25, position_y=0.015, width=0.5, height=0.095,
)  # fmt: skip
bar.SetLookupTable(scale)
plotter.camera_position = [(4.1, -5.0, 3.4), (0.0, 0.0, -0.12), (0.0, 0.0, 1.0)]
plotter.screenshot("vdb_volume.png")
plotter.close()

# %%
# Limits
# ------
# `violation_grid` is a picture of the field, not a bound: values are float32 at voxel centres. How to open the file
# in Blender and ParaView: :doc:`/howto/vdb_files`.
#
# Source of the file format: K. Museth, 2013; see :doc:`/references`. The violation is ours.
