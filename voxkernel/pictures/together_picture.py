"""Many scans before and after they are laid together, and how far each is off the others."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from voxkernel._palette import distinct_color, hex_of
from voxkernel.errors import VoxKernelError
from voxkernel.mesh import TriangleMesh, as_mesh
from voxkernel.mesh.triangles import without_strays
from voxkernel.pictures.camera import as_up
from voxkernel.pictures.fit_html import write_fit_html
from voxkernel.pictures.fit_png import LEAST, write_fit_png
from voxkernel.pictures.fit_scene import (
    UNEXPLAINED,
    Panel,
    before_panel,
    colored,
    fit_of,
    moved,
    plain_layer,
    thinned,
    view_of,
)
from voxkernel.pictures.parts import check_picture, check_size
from voxkernel.registration import JointRegistration

__all__ = ["together_picture"]

_REACH = 0.02  # of the diagonal of what was laid together
_MOST_NAMES = 14


def together_picture(
    path: str | os.PathLike[str],
    surfaces: Sequence[Any],
    found: JointRegistration,
    *,
    names: Sequence[str] = (),
    title: str = "",
    size: tuple[int, int] = (1400, 1380),
    up: ArrayLike | None = None,
) -> None:
    """Draw many scans as given and laid together, a colour each, and how far each is off all others.

    Before and after are seen from the same side; scans that lie far apart are moved beside each other. The distances
    are seen from there and from the opposite side. A bar in mesh units with the histogram says what the colours mean;
    grey is what no other scan explains within 2 % of the diagonal. Scans that belong to nothing are grey before and not
    shown after; those that cannot be read are not shown at all.

    Parameters
    ----------
    path : str or os.PathLike
        Ends in ``.png`` (no display needed) or ``.html`` (one offline page that can be turned).
    surfaces : sequence
        The surfaces that were registered, in the same order.
    found : JointRegistration
        From `register_together`.
    names : sequence of str
        One for each surface; their positions by default.
    title : str
        Heading.
    size : (int, int)
        Pixels of a ``.png``.
    up : (3,) array_like, optional
        The direction that points up after the motion, the frame of the first scan; the longest direction by default.

    Raises
    ------
    ValueError
        If the suffix is another, `size` is too small or too large, `up` is no direction, the surfaces are more or
        fewer than the poses, or nothing was laid together.
    OSError
        If the file cannot be written.
    """
    place, kind = check_picture(path)
    pixels = check_size(size, LEAST)
    wanted = as_up(up)
    n = len(found.poses)
    if len(surfaces) != n:
        raise ValueError(f"`surfaces` must be the {n} that were registered; got {len(surfaces)}")
    kept = [i for i in range(n) if i not in found.apart]
    if not kept:
        raise ValueError("`found` must hold scans that belong together; got none")
    called = [str(name) for name in names] or [f"scan {i}" for i in range(n)]
    meshes = {i: as_mesh(surfaces[i]) if i in kept else _if_usable(surfaces[i]) for i in range(n)}
    shown = {i: thinned(*without_strays(m.vertices, m.faces), n) for i, m in meshes.items() if m is not None}
    colors = {i: hex_of(distinct_color(k)) for k, i in enumerate(kept)}
    laid = [(moved(shown[i][0], found.poses[i]), shown[i][1]) for i in kept]
    extent = float(np.linalg.norm(np.ptp(np.concatenate([v for v, _ in laid]), axis=0)))
    fit = fit_of(laid, _REACH * extent)
    view, upward = view_of(laid, wanted)
    before = tuple(plain_layer(v, f, colors.get(i, UNEXPLAINED), called[i]) for i, (v, f) in shown.items())
    after = tuple(plain_layer(v, f, colors[i], called[i]) for i, (v, f) in zip(kept, laid, strict=True))
    far = tuple(
        colored(v, f, d, fit.end, called[i]) for i, (v, f), d in zip(kept, laid, fit.distances, strict=True)
    )
    panels = [
        before_panel("before: as given", before, extent, view, upward),
        Panel("after: in one frame", after, view, upward),
        Panel("distance to the other scans", far, view, upward),
        Panel("distance to the other scans, from behind", far, -view, upward),
    ]
    used = sum(p.use in ("tree", "loop") for p in found.pairs)
    words = (
        f"{len(kept)} of {n} scans belong together; {used} of {len(found.pairs)} pairs used; "
        f"residual {found.residual:.3g} (as the tree lays them {found.tree_residual:.3g})"
    )
    legend = [(called[i], colors[i]) for i in kept[:_MOST_NAMES]]
    if len(kept) > _MOST_NAMES:
        legend.append((f"and {len(kept) - _MOST_NAMES} more", "#ffffff"))
    legend += [(f"{called[i]}: belongs to nothing", UNEXPLAINED) for i in found.apart[:4]]
    legend.append((f"unexplained within {fit.reach:.3g}", UNEXPLAINED))
    if kind == ".html":
        write_fit_html(place, title, words, panels, fit, legend)
    else:
        write_fit_png(place, title, words, panels, fit, legend, pixels)


def _if_usable(surface: Any) -> TriangleMesh | None:
    """Read a surface that has no pose; it may have none because it cannot be used."""
    try:
        return as_mesh(surface)
    except (VoxKernelError, OSError, TypeError):
        return None
