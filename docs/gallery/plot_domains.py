"""
Where kernels are looked for
============================

A relaxed kernel may reach outside a closed shape: from a point beside it, only a part of the surface is
turned away. Closed shapes therefore have their convex hull as domain. The kernel of an open surface may have
no end; it is looked for in a ball about the area centroid, which moves with the surface and is not cut at the
crop border as a hull would be. Both are convex polytopes that the exact kernel and the octree share.
"""

import sys
from pathlib import Path

import numpy as np
import pyvista

import voxkernel
from voxkernel.demo_shapes import comet, face
from voxkernel.domain import ball_domain, hull_domain


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
    plotter.add_mesh(polydata(grid.to_mesh()), color="#d9772b")
    text = f"domain: {domain.kind}, kernel at a tolerance of {100 * share:.0f} % of the area"
    plotter.add_text(text, font_size=11, color="#222222", position="upper_left")
    plotter.camera.focal_point = domain.vertices.mean(axis=0)
    plotter.camera.position = domain.vertices.mean(axis=0) + distance * np.linalg.norm(edge, axis=1).max() * np.array(view)
    plotter.camera.up = (0, 0, 1)
    plotter.enable_anti_aliasing("ssaa")
    plotter.set_background("white")
    plotter.screenshot(path)
    plotter.close()
    return grid


folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
body = voxkernel.as_mesh(comet())
picture(body, hull_domain(body), 0.16, (0.3, -0.75, 0.6), 3.4, folder / "domain_hull.png")
surface = voxkernel.as_mesh(face())
picture(surface, ball_domain(surface), 0.05, (0.8, -0.5, 0.35), 4.6, folder / "domain_ball.png")
