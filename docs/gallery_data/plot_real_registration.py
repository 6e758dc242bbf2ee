"""
Registration of real scans
==========================

Virtual scans of model faces, noisy and cropped, in random poses, laid on the models they were made from. The true
motions are known.
"""

import json
import os
from pathlib import Path

import numpy as np
import pyvista

import voxkernel

data = Path(os.environ["VOXKERNEL_DATA"])
truth = json.loads((data / "scans" / "ground_truth.json").read_text(encoding="utf-8"))["scans"]

# %%
# The calls
# ---------
shown = []
for stem in ("scan_ict01_neutral", "scan_ict02_neutral", "scan_ict05_neutral"):
    scan = voxkernel.as_mesh(data / "scans" / f"{stem}.ply")
    model = voxkernel.as_mesh(data / "faces" / f"{stem.removeprefix('scan_')}.ply")
    found = voxkernel.register(scan, model)
    T_scan_model = np.array(truth[f"{stem}.ply"]["T_ref_to_scan"])
    rest = found.T_target_source @ T_scan_model
    angle = np.degrees(np.arccos(np.clip((np.trace(rest[:3, :3]) - 1) / 2, -1, 1)))
    print(f"{stem}: off by {angle:.3f} degrees, {found}")
    shown.append((scan, model, found))

# %%
# The picture
# -----------
plotter = pyvista.Plotter(off_screen=True, shape=(2, 3), window_size=(1650, 1050), border=False)
plotter.set_background("white", all_renderers=True)
for column, (scan, model, found) in enumerate(shown):
    for row, T in enumerate((np.eye(4), found.T_target_source)):
        plotter.subplot(row, column)
        moved = pyvista.PolyData.from_regular_faces(scan.vertices @ T[:3, :3].T + T[:3, 3], scan.faces)
        plotter.add_mesh(moved, color="#e8650a", smooth_shading=True, opacity=1.0 if row == 0 else 0.6, ambient=0.2)
        plotter.add_mesh(model.to_polydata(), color="#7fb0e6", smooth_shading=True, ambient=0.2)
        plotter.add_text("before" if row == 0 else "after", font_size=13, color="#1d2733")
        plotter.view_vector((0.55, 0.15, 1.0), (0, 1, 0))
        plotter.camera.zoom(1.3)
        plotter.enable_anti_aliasing("ssaa")
plotter.screenshot("real_registration.png")
plotter.close()

# %%
# Limits
# ------
# Three pairs, scans of the very faces they are laid on. How often it works, and how well, is measured by
# ``datasets_tools/evaluate_registration.py``. :doc:`/howto/registering_scans` has the call.
#
# Source: N. Werghi, 2008, section IV.B and figure 5; see :doc:`/references`.
