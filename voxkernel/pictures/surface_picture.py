"""Pictures of a surface and its kernel: PNG, drawn off screen, or an offline HTML page to turn by hand."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_path
from voxkernel.mesh import MeshLike, TriangleMesh, as_mesh
from voxkernel.pictures.camera import as_up
from voxkernel.pictures.interactive_html import Plate, write_html
from voxkernel.pictures.level_surface import RESOLUTION
from voxkernel.pictures.parts import check_picture, check_size
from voxkernel.pictures.png import write_png
from voxkernel.pictures.scene import Scene, caption_of, make_scene
from voxkernel.pictures.sphere_picture import sphere_picture
from voxkernel.relaxed import best_center

__all__ = ["interactive_page", "sphere_picture", "surface_picture"]


def surface_picture(
    path: str | os.PathLike[str],
    surface: MeshLike,
    kernel: Any,
    *,
    title: str = "",
    caption: str | None = None,
    size: tuple[int, int] = (1400, 1000),
    up: ArrayLike | None = None,
    voxels: bool = False,
) -> None:
    """Draw a surface, translucent, and its kernel, solid.

    Parameters
    ----------
    path : str or os.PathLike
        ``.png`` for a picture, ``.html`` for one page that needs no network (about 5 MB).
    surface : mesh, path or (vertices, faces)
        Anything `as_mesh` takes.
    kernel : KernelPolytope, KernelGrid or None
        What `exact_kernel` or `voxel_kernel` gave for the surface. Of an empty kernel the facets of its
        certificate are drawn in red, each with a piece of its plane and an arrow to its inner side.
    title, caption : str
        Words above the picture; the caption says verdict, volume and ratio by default.
    size : (int, int)
        Width and height of a PNG, pixels, at least 200 each.
    up : (3,) array_like, optional
        The direction that points up in the picture; by default that of the file (y of ``.glb``), else y or z, whichever
        is longer. Open surfaces look at the viewer.
    voxels : bool
        Draw a relaxed kernel as its voxels; by default, of surfaces of up to some 120,000 facets, as the smooth surface
        on which the violation reaches the tolerance, contoured on a grid.

    Raises
    ------
    ValueError
        If the suffix is neither, `size` is too small or too large, or `up` is no direction.
    MeshError, MeshReadError, TypeError
        If the surface cannot be used.
    OSError
        If the file cannot be written.

    Notes
    -----
    PNG needs PyVista and no display; HTML needs plotly. A kernel too small to be seen gets a close-up.
    Axes, a scale bar in mesh units and a legend stand below: exact kernels are orange, relaxed ones purple; the deepest
    point, or the star centre, is a yellow dot. Where a domain cuts the kernel, its outline is drawn and named.

    Examples
    --------
    >>> import pathlib, tempfile, voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "tetrahedron.html"
    ...     surface_picture(file, tetrahedron, voxkernel.exact_kernel(tetrahedron))
    ...     "star-shaped" in file.read_text(encoding="utf-8")
    True
    """
    target, kind = check_picture(path)
    pixels = check_size(size, (200, 200))
    mesh = as_mesh(surface)
    words = caption_of(mesh, kernel) if caption is None else caption
    scene = _scene(mesh, kernel, as_up(up), 0 if voxels else RESOLUTION)
    if kind == ".png":
        write_png(target, scene, title=title, caption=words, size=pixels)
    else:
        write_html(target, [Plate(scene, title, words)])


def _scene(mesh: TriangleMesh, kernel: Any, up: NDArray[np.float64] | None, resolution: int) -> Scene:
    """What to draw, with the star centre of a relaxed kernel."""
    center = None
    if getattr(kernel, "tolerance", 0.0) and not kernel.is_empty:
        center = best_center(mesh, domain=kernel.domain).point
    return make_scene(mesh, kernel, up=up, resolution=resolution, center=center)


def interactive_page(path: str | os.PathLike[str], items: Sequence[tuple[str, Any, Any]]) -> None:
    """Write one offline HTML page with a menu of surfaces and their kernels.

    Parameters
    ----------
    path : str or os.PathLike
        Ends in ``.html``.
    items : sequence of (title, surface, kernel)
        At least one; surface and kernel as in `surface_picture`.

    Raises
    ------
    ValueError
        If there are no items or the suffix is another.
    OSError
        If the file cannot be written.
    """
    target = as_path("path", path)
    if target.suffix.lower() != ".html":
        raise ValueError(f"`path` must end in .html; got '{target.name}'")
    if not items:
        raise ValueError("`items` must hold at least one surface; got 0")
    plates: list[Plate] = []
    for title, surface, kernel in items:
        mesh = as_mesh(surface)
        plates.append(Plate(_scene(mesh, kernel, None, RESOLUTION), title, caption_of(mesh, kernel)))
    write_html(target, plates)
