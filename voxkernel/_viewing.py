"""The one way up: `plot` of meshes and kernels opens the viewer, which is made of them and imported by name."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from voxkernel.view import Viewer

__all__ = ["plot_kernel", "plot_mesh"]


def plot_mesh(self: Any, kernel: Any = None, **options: Any) -> Viewer:
    """Show the surface and its kernel in the browser.

    Parameters
    ----------
    kernel : KernelPolytope or KernelGrid, optional
        What was computed for it; computed by default.
    **options
        As for `voxkernel.view.open_viewer`.

    Returns
    -------
    Viewer
        Shows itself in a notebook; its `wait` keeps a script going until Ctrl-C.

    Raises
    ------
    MeshError, TypeError, ValueError, SolverError
        As `voxkernel.view.open_viewer`.
    """
    return import_module("voxkernel.view").open_viewer(self, kernel, **options)


def plot_kernel(self: Any, surface: Any = None, **options: Any) -> Viewer:
    """Show the kernel in the browser.

    Parameters
    ----------
    surface : mesh, path or (vertices, faces), optional
        Of which it is the kernel. A kernel does not keep its surface: without one its own faces are shown as the
        surface, and the probe is held against their planes.
    **options
        As for `voxkernel.view.open_viewer`.

    Returns
    -------
    Viewer
        Shows itself in a notebook; its `wait` keeps a script going until Ctrl-C.

    Raises
    ------
    MeshError
        Without a surface, if the kernel has no faces.
    MeshReadError, TypeError, ValueError, SolverError
        As `voxkernel.view.open_viewer`.
    """
    if surface is None:
        options = {"title": "kernel", **options}
        return import_module("voxkernel.view").open_viewer(self.to_mesh(), None, **options)
    return import_module("voxkernel.view").open_viewer(surface, self, **options)
