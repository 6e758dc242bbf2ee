"""
Registration before and after
=============================

The kernel moves with its surface, so two surfaces can be brought together by their kernels (Werghi 2008, figure 5).
Kernels of scans are empty; relaxed kernels take their place. The second surface is another sampling of the first, with
noise, cropped, turned by far.
"""

import numpy as np

import voxkernel
from voxkernel.demo_shapes import face
from voxkernel.pictures import registration_picture


def noisy_copy(mesh, seed, angles_deg, shift):
    """A scan of the same face: other triangles, noise, a smaller crop, another pose."""
    rng = np.random.default_rng(seed)
    points = mesh.vertices + 0.002 * rng.normal(size=mesh.vertices.shape)
    middle = points[mesh.faces].mean(axis=1) - mesh.vertices[0]
    kept = mesh.faces[np.linalg.norm(middle - [0.03, 0.02, -0.2], axis=1) < 0.98]
    turn = np.eye(3)
    for axis, angle in enumerate(np.radians(angles_deg)):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        one = np.eye(3)
        one[i, i] = one[j, j] = np.cos(angle)
        one[i, j], one[j, i] = -np.sin(angle), np.sin(angle)
        turn = one @ turn
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = turn, shift
    return voxkernel.as_mesh((points @ turn.T + shift, kept)), T


target = voxkernel.as_mesh(face(hook=0.2, rings=52, sectors=120))
source, T_source_target = noisy_copy(face(hook=0.2), 3, (75.0, -40.0, 110.0), (1.7, 0.9, -0.4))

# %%
# The call
# --------
# No first guess is needed. `fitness` is the share of the *source's* area that ends near the target; `ambiguous` says
# that another motion fits as well.
found = voxkernel.register(source, target)
print(found)


def error(T_target_source):
    """Angle and distance to the true motion."""
    rest = T_target_source @ T_source_target
    angle = np.degrees(np.arccos(np.clip((np.trace(rest[:3, :3]) - 1) / 2, -1, 1)))
    middle = target.vertices.mean(axis=0)
    return angle, np.linalg.norm(rest[:3, :3] @ middle + rest[:3, 3] - middle)


for stage, T in (("kernels alone", found.kernel_T_target_source), ("after ICP", found.T_target_source)):
    angle, distance = error(T)
    print(f"{stage}: off by {angle:.3f} degrees and {distance:.5f}")
assert error(found.T_target_source)[0] < 1.0

# %%
# The picture
# -----------
# The kernels are relaxed ones, computed as `register` does. Distances have a bar in mesh units; what has no counterpart
# is grey.
registration_picture("registration.png", source, target, found, title="A face, and another scan of it", up=(0, 1, 0))

# %%
# Limits
# ------
# The two surfaces must show much the same part of an object; `overlap_steps` crops them to where they overlap and
# tries again. A symmetric object has several right answers: `ambiguous` and `candidates` say so. See
# :doc:`/howto/registering_scans`.
#
# Source: N. Werghi, "The Discrete Surface Kernel: Framework and Applications", 2008, section IV.B and figure 5. The
# paper registers exact kernels; the relaxed ones are ours.
