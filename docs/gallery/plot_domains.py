"""
The hull and the ball: where kernels are looked for
===================================================

A relaxed kernel may reach outside a closed shape: from a point beside it, only a part of the surface is
turned away. Closed shapes therefore have their convex hull as domain. The kernel of an open surface may have
no end; it is looked for in a ball about the area centroid, which moves with the surface and is not cut at the
crop border as a hull would be. Both are convex polytopes that the exact kernel and the octree share.
"""

import voxkernel
from voxkernel.demo_shapes import comet, face
from voxkernel.pictures import surface_picture


def picture(mesh, domain, share, path):
    """Draw a surface, the domain where it cuts, and the relaxed kernel."""
    grid = voxkernel.voxel_kernel(mesh, tolerance=share, domain=domain, depth=7)
    title = f"domain: {domain}, kernel at a tolerance of {100 * share:.0f} % of the area"
    surface_picture(path, mesh, grid, title=title, size=(1100, 800))
    return grid


# %%
# A closed body and its hull
# --------------------------
body = voxkernel.as_mesh(comet())
print(picture(body, "hull", 0.16, "domain_hull.png"))

# %%
# An open surface and its ball
# ----------------------------
surface = voxkernel.as_mesh(face())
print(picture(surface, "ball", 0.05, "domain_ball.png"))

# %%
# Limits
# ------
# A domain cuts: `cut_by_domain` of an exact kernel says whether it did. The verdict of `starshapeness` never depends
# on it. All domains and their defaults: :doc:`/domains`.
#
# Source of the kernel: N. Werghi, 2008, who looks for it in a grid around the surface; see :doc:`/references`. The
# domains are ours.
