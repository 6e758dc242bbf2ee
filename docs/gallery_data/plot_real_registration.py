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

import voxkernel
from voxkernel.pictures import registration_picture

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
scan, model, found = shown[0]
registration_picture("real_registration.png", scan, model, found, title="A scan on its model", up=(0, 1, 0))

# %%
# Limits
# ------
# Three pairs, scans of the very faces they are laid on. How often it works, and how well, is measured by
# ``datasets_tools/evaluate_registration.py``. :doc:`/howto/registering_scans` has the call.
#
# Source: N. Werghi, 2008, section IV.B and figure 5; see :doc:`/references`.
