"""Labelled families of shapes: which formulas belong to which, and series of one base."""

from __future__ import annotations

from collections.abc import Callable
from zlib import crc32

import faulty_shapes as faulty
import known_shapes as known
import numpy as np
import shape_formulas as sf
from known_shapes import Shape

_SERIES = 6

Make = Callable[[np.random.Generator, int], Shape]


def make_shape(family: str, index: int, *, seed: int, facets: int) -> tuple[str, Shape]:
    """Make shape `index` of a family; it depends on nothing else than these arguments.

    Returns
    -------
    kind : str
        Which of the family's formulas it is; they take turns.
    shape : Shape
        The surface and its truth.
    """
    makers = FAMILIES[family]
    if family in SERIES:  # all levels of a series have the same base
        series, level = divmod(index, _SERIES)
        name = list(makers)[series % len(makers)]
        rng = np.random.default_rng([seed, crc32(f"{family}/{name}".encode()), series])
        shape = SERIES[family](makers[name], rng, facets, level)
        shape.parameters.update(series=series, level=level)
        return name, shape
    name = list(makers)[index % len(makers)]
    return name, makers[name](np.random.default_rng([seed, crc32(f"{family}/{name}".encode()), index]), facets)


# ---------------------------------------------------------------- series: one base, six levels


def _noisy(make: Make, rng: np.random.Generator, facets: int, level: int) -> Shape:
    """Noise of 0 to 10 % along the radius, which leaves a surface star-shaped from the origin, and does not leave
    it if it is added in all directions: of that nothing is known beforehand but for level 0.
    """
    base = make(rng, facets)
    sigma = (0.0, 0.005, 0.01, 0.02, 0.05, 0.1)[level]
    vertices, faces = base.surface
    radial = bool(rng.random() < 0.5)
    if radial:
        noise = np.exp(sigma * rng.standard_normal((len(vertices), 1)))
        return Shape((vertices * noise, faces), 3, None, 0.0, {"sigma": sigma, "noise": "radial"})
    moved = vertices + sigma * rng.standard_normal(vertices.shape)
    known = level == 0
    return Shape((moved, faces), 3 if known else None, None, 0.0 if known else None, {"sigma": sigma, "noise": "any"})


def _centred_bumpy(rng: np.random.Generator, facets: int) -> Shape:
    directions, faces = sf.sphere_for(facets)
    axes = rng.standard_normal((5, 3)) * 2.0
    wave = np.cos(directions @ axes.T + rng.uniform(0, 2 * np.pi, 5)).mean(axis=1)
    return Shape((directions * np.exp(0.4 * wave)[:, None], faces), 3)


def _centred_sphere(rng: np.random.Generator, facets: int) -> Shape:
    directions, faces = sf.sphere_for(facets)
    return Shape((directions * rng.uniform(0.6, 1.6, 3), faces), 3)


def _retriangulated(make: Make, rng: np.random.Generator, facets: int, level: int) -> Shape:
    """The same surface in other triangles: 0 as made, 1 shuffled, 2 and 3 with split triangles, 4 and 5 subdivided."""
    base = make(rng, max(facets // 16, 1))
    surface = base.surface
    if level in (2, 3):
        surface = sf.split_facets(surface, rng, 4 ** (level - 1))
    for _ in range(level - 3):
        surface = sf.subdivided(surface)
    surface = sf.shuffled(surface, rng) if level else surface
    return Shape(surface, base.dimension, base.kernel_volume, base.defect, dict(base.parameters))


FAMILIES: dict[str, dict[str, Make]] = {
    "convex": known.CONVEX, "star": known.STAR, "near-star": faulty.NEAR_STAR, "non-star": faulty.NON_STAR,
    "thin": faulty.THIN, "open": known.OPEN, "noise": {"bumpy-sphere": _centred_bumpy, "ellipsoid": _centred_sphere},
    "retriangulated": {
        "notched-box": known.STAR["notched-box"], "star-prism": known.STAR["star-prism"], "point": faulty.THIN["point"],
    },
}  # fmt: skip
SERIES: dict[str, Callable[[Make, np.random.Generator, int, int], Shape]] = {
    "noise": _noisy, "retriangulated": _retriangulated,
}  # fmt: skip
