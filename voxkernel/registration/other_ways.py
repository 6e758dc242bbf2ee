"""Where nothing fits: one surface with its facets turned over, and other sizes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.registration.icp import Refine
from voxkernel.registration.pair import Solution, solve
from voxkernel.registration.prepare import PreparedSurface, prepare
from voxkernel.registration.verdict import RIGHT

__all__ = ["facets_turned", "fitting_size", "resized", "size_ratios"]

Pair = tuple[PreparedSurface, PreparedSurface]

_SAME_RATIO = 0.03  # ratios nearer than this are tried once
_ALIKE = 0.15  # by which the ratios of kernels, areas and diagonals may differ where whole surfaces differ in size
_LEAST_CHANGE = 0.05
_QUICK = 1  # sources of candidates tried for another way
_SURE = 0.9  # an answer as probable as this is not compared with that of facets turned over


def facets_turned(pair: Pair, found: Solution, method: Refine) -> Solution | None:
    """Turn the facets of the first surface over; None where that cannot help or what was found is more probable."""
    one, two = (_side(p) for p in pair)
    if one * two > 0 or (found.judged.probability >= _SURE and one * two == 0):
        return None
    mesh = pair[0].mesh
    over = prepare(mesh.from_triangles(mesh.vertices, mesh.faces[:, ::-1], source=mesh.source), pair[0].margins)
    turned = over, pair[1]
    other = solve(turned, turned, method, sources=_QUICK)
    return other if other.judged.probability >= max(RIGHT, found.judged.probability) else None


def _side(surface: PreparedSurface) -> float:
    """Give the sign of the volume that a closed surface encloses; 0 of an open one."""
    if surface.skin.rim.vertices.any():
        return 0.0
    a, b, c = surface.skin.vertices[surface.skin.faces].transpose(1, 0, 2)
    return float(np.sign(np.einsum("ij,ij->", a, np.cross(b, c))))


def resized(surface: PreparedSurface, factor: float) -> PreparedSurface:
    """Prepare a surface that is so many times as large, about the origin."""
    mesh = surface.mesh
    return prepare(mesh.from_triangles(mesh.vertices * factor, mesh.faces, source=mesh.source), surface.margins)


def size_ratios(source: PreparedSurface, target: PreparedSurface) -> list[float]:
    """Sizes of the target over those of the source: by kernels, by area and by diagonal, without repetition."""
    kernels = [
        (two.mass / one.mass) ** (1.0 / 3.0)
        for one, two in zip(source.moments, target.moments, strict=True)
        if one.dimension == two.dimension == 3
    ]
    kept: list[float] = []
    for ratio in (*sorted(kernels, reverse=True)[:1], *_plain_ratios(source, target)):
        if all(abs(np.log(ratio / other)) > _SAME_RATIO for other in kept):
            kept.append(float(ratio))
    return kept


def _plain_ratios(source: PreparedSurface, target: PreparedSurface) -> tuple[float, float]:
    return (target.area / source.area) ** 0.5, target.diagonal / source.diagonal


def fitting_size(pair: Pair, method: Refine) -> float | None:
    """The scale between whole surfaces of other sizes, where all measures of size agree and the fit is believed."""
    ratios = size_ratios(*pair)
    logs: NDArray[np.float64] = np.log([*ratios, *_plain_ratios(*pair)])
    if np.ptp(logs) > _ALIKE or abs(float(np.median(logs))) < _LEAST_CHANGE:
        return None
    factor = float(np.exp(np.median(logs)))
    changed = resized(pair[0], factor), pair[1]
    found = solve(changed, changed, method, sources=1)
    size = factor * found.judged.size
    close = found.judged.probability >= RIGHT or found.judged.other_size != 1.0
    return size if close else None
