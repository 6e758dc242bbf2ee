"""Two surfaces before and after registration, how far they are off, and their kernels, as a picture or a page."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel.pictures.fit_html import write_fit_html
from voxkernel.pictures.fit_png import write_fit_png
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
from voxkernel.pictures.parts import check_picture
from voxkernel.registration import Registration
from voxkernel.registration.prepare import PreparedSurface

__all__ = ["registration_picture"]

_SOURCE, _TARGET = "#d9822b", "#5b8db8"


def registration_picture(
    path: str | os.PathLike[str],
    source: PreparedSurface,
    target: PreparedSurface,
    found: Registration,
    *,
    title: str = "",
    size: tuple[int, int] = (1400, 1600),
) -> None:
    """Draw source (orange) and target (blue) before and after the motion, how far they are off, and their kernels.

    Before and after are seen from the same side; surfaces that lie far apart are moved beside each other. Below, each
    surface has the colours of its distance to the other one; what has no counterpart within `found.max_distance` that
    faces the same way is grey. A bar in mesh units with the histogram says what the colours mean. The last row holds
    the relaxed kernels, where both have one.

    Parameters
    ----------
    path : str or os.PathLike
        Ends in ``.png`` (no display needed) or ``.html`` (one offline page that can be turned).
    source, target : PreparedSurface
        From `prepare_surface`.
    found : Registration
        What `register` found for them.
    title : str
        Heading.
    size : (int, int)
        Pixels of a ``.png``.

    Raises
    ------
    ValueError
        If the suffix is another.
    OSError
        If the file cannot be written.
    """
    place, kind = check_picture(path)
    motion = found.T_target_source
    world = [moved(s.vertices, s.T_world_local) for s in (source, target)]
    shown = [thinned(v, s.faces, 2) for v, s in zip(world, (source, target), strict=True)]
    (points, faces), (points_there, faces_there) = shown
    laid = moved(points, motion)
    fit = fit_of([(laid, faces), (points_there, faces_there)], found.max_distance)
    view, up = view_of([(laid, faces), (points_there, faces_there)])
    extent = float(np.linalg.norm(np.ptp(np.concatenate([laid, points_there]), axis=0)))
    still = plain_layer(points_there, faces_there, _TARGET, "target")
    panels = [
        before_panel("before", (still, plain_layer(points, faces, _SOURCE, "source")), extent, view, up),
        Panel("after", (still, plain_layer(laid, faces, _SOURCE, "source")), view, up),
        Panel("source: distance to the target", (colored(laid, faces, fit.distances[0], fit.end, "source"),), view, up),
        Panel(
            "target: distance to the source",
            (colored(points_there, faces_there, fit.distances[1], fit.end, "target"),), view, up,
        ),
    ]  # fmt: skip
    kernels = _kernels(source, _SOURCE, "kernel of the source"), _kernels(target, _TARGET, "kernel of the target")
    if kernels[0] is not None and kernels[1] is not None:
        after = Layer(moved(kernels[0].vertices, motion), kernels[0].faces, kernels[0].colors, kernels[0].name)
        room = float(np.linalg.norm(np.ptp(np.concatenate([after.vertices, kernels[1].vertices]), axis=0)))
        panels.append(before_panel("kernels before", (kernels[1], kernels[0]), room, view, up))
        panels.append(Panel("kernels after", (kernels[1], after), view, up))
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
        write_fit_png(place, title, words, panels, fit, legend, size)


def _kernels(surface: PreparedSurface, color: str, name: str) -> Any:
    """Give the kernel of the smallest margin that is not empty, or None."""
    kernel = next((k for k in surface.kernels if k.active_voxel_count), None)
    if kernel is None:
        return None
    mesh = kernel.to_mesh()
    vertices: NDArray[np.float64] = moved(mesh.vertices, surface.T_world_local)
    return plain_layer(vertices, mesh.faces, color, name)
