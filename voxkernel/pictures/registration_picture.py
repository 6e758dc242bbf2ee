"""Two surfaces before and after registration, how far they are off, and their kernels, as a picture or a page."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from voxkernel.mesh import MeshLike, TriangleMesh
from voxkernel.pictures.camera import as_up
from voxkernel.pictures.fit_html import write_fit_html
from voxkernel.pictures.fit_png import LEAST, write_fit_png
from voxkernel.pictures.fit_scene import (
    UNEXPLAINED,
    Layer,
    Panel,
    before_panel,
    colored,
    fit_of,
    moved,
    plain_layer,
    thinned,
    view_of,
)
from voxkernel.pictures.level_surface import level_surface
from voxkernel.pictures.parts import check_picture, check_size
from voxkernel.registration import Registration, prepare_surface
from voxkernel.registration.prepare import PreparedSurface, simplified

__all__ = ["registration_picture"]

_SOURCE, _TARGET = "#d9822b", "#5b8db8"


def registration_picture(
    path: str | os.PathLike[str],
    source: MeshLike | PreparedSurface,
    target: MeshLike | PreparedSurface,
    found: Registration,
    *,
    title: str = "",
    size: tuple[int, int] = (1400, 1680),
    up: ArrayLike | None = None,
) -> None:
    """Draw source (orange) and target (blue) before and after the motion, how far they are off, and their kernels.

    Before and after are seen from the same side; surfaces that lie far apart are moved beside each other. Below, each
    surface has the colours of its distance to the other one; what has no counterpart within `found.max_distance` that
    faces the same way is grey. A bar in mesh units with the histogram says what the colours mean. The last row holds
    the relaxed kernels, where both have one, as the smooth surfaces that `surface_picture` draws.

    Parameters
    ----------
    path : str or os.PathLike
        Ends in ``.png`` (no display needed) or ``.html`` (one offline page that can be turned).
    source, target : mesh, path, (vertices, faces) or PreparedSurface
        As they were given to `register`; those of `prepare_surface` are not prepared again.
    found : Registration
        What `register` found for them.
    title : str
        Heading.
    size : (int, int)
        Pixels of a ``.png``.
    up : (3,) array_like, optional
        The direction that points up after the motion, the frame of the target; the longest direction by default.

    Raises
    ------
    ValueError
        If the suffix is another, `size` is too small or too large, or `up` is no direction.
    MeshError, MeshReadError
        If a surface cannot be used.
    TypeError
        If a surface is none, or `found` is not what `register` gives.
    OSError
        If the file cannot be written.
    """
    place, kind = check_picture(path)
    if not isinstance(found, Registration):  # pyright: ignore[reportUnnecessaryIsInstance]
        raise TypeError(f"`found` must be a Registration, what `register` gives; got {type(found).__name__}")
    pixels = check_size(size, LEAST)
    wanted = as_up(up)
    motion = found.T_target_source
    pair = [s if isinstance(s, PreparedSurface) else prepare_surface(s) for s in (source, target)]
    shown = [thinned(moved(s.vertices, s.T_world_local), s.faces, 2) for s in pair]
    (points, faces), (points_there, faces_there) = shown
    laid = moved(points, motion)
    fit = fit_of([(laid, faces), (points_there, faces_there)], found.max_distance)
    view, upward = view_of([(laid, faces), (points_there, faces_there)], wanted)
    extent = float(np.linalg.norm(np.ptp(np.concatenate([laid, points_there]), axis=0)))
    far = [
        colored(laid, faces, fit.distances[0], fit.end, "source"),
        colored(points_there, faces_there, fit.distances[1], fit.end, "target"),
    ]
    still = plain_layer(points_there, faces_there, _TARGET, "target")
    panels = [
        before_panel("before", (still, plain_layer(points, faces, _SOURCE, "source")), extent, view, upward),
        Panel("after", (still, plain_layer(laid, faces, _SOURCE, "source")), view, upward),
        Panel("source: distance to the target", (far[0],), view, upward),
        Panel("target: distance to the source", (far[1],), view, upward),
    ]  # fmt: skip
    kernels = _kernels(pair[0], _SOURCE, "kernel of the source"), _kernels(pair[1], _TARGET, "kernel of the target")
    if kernels[0] is not None and kernels[1] is not None:
        after = Layer(moved(kernels[0].vertices, motion), kernels[0].faces, kernels[0].colors, kernels[0].name)
        room = float(np.linalg.norm(np.ptp(np.concatenate([after.vertices, kernels[1].vertices]), axis=0)))
        panels.append(before_panel("kernels before", (kernels[1], kernels[0]), room, view, upward))
        panels.append(Panel("kernels after", (kernels[1], after), view, upward))
    words = (
        f"{found.verdict}; {100 * found.fitness:.1f} % of the source within {found.max_distance:.3g}, "
        f"RMS {found.inlier_rmse:.3g}" + (f"; {found.reason}" if found.reason else "")
    )
    legend = [
        ("source", _SOURCE), ("target", _TARGET),
        (f"unexplained: nothing within {fit.reach:.3g} that faces the same way", UNEXPLAINED),
    ]  # fmt: skip
    if kind == ".html":
        write_fit_html(place, title, words, panels, fit, legend)
    else:
        write_fit_png(place, title, words, panels, fit, legend, pixels)


def _kernels(surface: PreparedSurface, color: str, name: str) -> Any:
    """Give the kernel of the smallest margin that is not empty, or None."""
    kernel = next((k for k in surface.kernels if k.active_voxel_count), None)
    if kernel is None:
        return None
    own = simplified(surface.smooth, surface.skin.faces, surface.diagonal)  # what its kernels are of
    vertices, faces = level_surface(TriangleMesh.from_triangles(*own), kernel)
    if not len(faces):  # thinner than the samples
        mesh = kernel.to_mesh()
        vertices, faces = mesh.vertices, mesh.faces
    return plain_layer(moved(vertices, surface.T_world_local), faces, color, name)
