"""
The hull and the ball: where kernels are looked for
===================================================

A relaxed kernel may reach outside a closed shape: from a point beside it, only a part of the surface is
turned away. Closed shapes therefore have their convex hull as domain. The kernel of an open surface may have
no end; it is looked for in a ball about the area centroid, which moves with the surface and is not cut at the
crop border as a hull would be. Both are convex polytopes that the exact kernel and the octree share.
"""

import numpy as np
import pyvista

import voxkernel
from voxkernel.demo_shapes import comet, face
from voxkernel.halfspaces import ball_domain, hull_domain


def polydata(mesh):
    """Give a triangle mesh to PyVista."""
    return pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces)


def picture(mesh, domain, share, view, distance, path):
    """Draw a surface, its domain as lines and its relaxed kernel as voxels."""
    grid = voxkernel.voxel_kernel(mesh, tolerance=share, domain=domain, depth=8)
    plotter = pyvista.Plotter(off_screen=True, window_size=(1100, 800))
    plotter.add_mesh(polydata(mesh), color="#7d9cc0", opacity=0.45, smooth_shading=True)
    edge = domain.vertices - domain.vertices.mean(axis=0)
    hull = pyvista.PolyData(domain.vertices).delaunay_3d().extract_surface(algorithm=None)
    plotter.add_mesh(hull, color="#c8c8c8", opacity=0.12)
    plotter.add_mesh(hull.extract_feature_edges(4), color="#8a8a8a", line_width=1, opacity=0.5)
    plotter.add_mesh(polydata(grid.to_mesh()), color="#a34a9c")
    text = f"domain: {domain.kind}, kernel at a tolerance of {100 * share:.0f} % of the area"
    plotter.add_text(text, font_size=11, color="#222222", position="upper_left")
    middle, radius = domain.vertices.mean(axis=0), np.linalg.norm(edge, axis=1).max()
    plotter.camera.focal_point = middle
    plotter.camera.position = middle + distance * radius * np.array(view)
    plotter.camera.up = (0, 0, 1)
    plotter.enable_anti_aliasing("ssaa")
    plotter.set_background("white")
    plotter.screenshot(path)
    plotter.close()
    return grid


# %%
# A closed body and its hull
# --------------------------
body = voxkernel.as_mesh(comet())
print(picture(body, hull_domain(body), 0.16, (0.3, -0.75, 0.6), 3.4, "domain_hull.png"))

# %%
# An open surface and its ball
# ----------------------------
surface = voxkernel.as_mesh(face())
print(picture(surface, ball_domain(surface), 0.05, (0.8, -0.5, 0.35), 4.6, "domain_ball.png"))

# %%
# Limits
# ------
# A domain cuts: `cut_by_domain` of an exact kernel says whether it did. The verdict of `starshapeness` never depends
# on it. All domains and their defaults: :doc:`/domains`.
#
# Source of the kernel: N. Werghi, 2008, who looks for it in a grid around the surface; see :doc:`/references`. The
# domains are ours.
