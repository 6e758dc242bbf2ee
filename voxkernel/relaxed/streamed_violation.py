"""How much of a streamed surface points do not face, and how its facets are weighed."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from math import fsum
from operator import add
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel.halfspaces import Domain, HalfSpaces
from voxkernel.halfspaces.surface_arguments import RELAXED
from voxkernel.large.passes import workers_of
from voxkernel.large.streamed_planes import StreamedPlanes
from voxkernel.large.surface_reader import SurfaceReader
from voxkernel.relaxed.facet_weights import UNITS, WeighedPlanes
from voxkernel.relaxed.violated_units import violated_units

__all__ = ["StreamedWeights", "relaxed_region", "streamed_violation"]


class StreamedWeights:
    """The facets of a stream with integer weights, those of memory to the last unit; two passes find their sum."""

    def __init__(self, reader: SurfaceReader, weights: Any) -> None:
        self.planes = StreamedPlanes(reader)
        self._given = _checked(weights, reader)
        self._largest = max((float(values.max()) for _, values in self._chunks("weights") if len(values)), default=0.0)
        if not self._largest > 0.0:
            raise ValueError("`weights` must have one above 0; got only zeros")
        self._total = fsum(chain.from_iterable((v / self._largest).tolist() for _, v in self._chunks("weights")))
        self.slack = self.planes.n_facet_planes + 1024  # as of `weigh`

    def _chunks(self, stage: str) -> Iterator[tuple[HalfSpaces, NDArray[np.float64]]]:
        for _, planes in self.planes.parts(stage):
            yield planes, self._values(planes)

    def _values(self, planes: HalfSpaces) -> NDArray[np.float64]:
        if isinstance(self._given, str):
            return planes.weights if self._given == "area" else np.ones(len(planes))
        return self._given[planes.facet_ids]

    def of(self, planes: HalfSpaces) -> WeighedPlanes:
        """Weigh the planes of a chunk; those without weight are left out."""
        values = self._values(planes)
        has_weight = values > 0
        kept, shares = planes.select(has_weight), self.shares(values[has_weight])
        units = np.maximum(np.rint(shares * UNITS), 1.0).astype(np.int64)
        return WeighedPlanes(kept, units, shares * (1.0 - 1e-14), self.slack)

    def chunks(self, stage: str) -> Iterator[WeighedPlanes]:
        """One pass over the facets of positive weight."""
        for _, planes in self.planes.parts(stage):
            weighed = self.of(planes)
            if len(weighed.weights):
                yield weighed

    def shares(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Shares of the whole."""
        return values / self._largest / self._total

    def share_of_facets(self, facets: list[int]) -> float:
        """A lower bound on the least share of some facets; 0 where there are none."""
        found = [w.shares[np.isin(w.facets.facet_ids, facets)] for w in self.chunks("weights")]
        return float(np.min(np.concatenate(found), initial=np.inf)) if facets else 0.0

    def violated(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """One pass: the integer weights that points violate, every sign exact."""
        return self.planes.folded("violation", lambda _, planes: violated_units(self.of(planes), points), add)


def _checked(weights: Any, reader: SurfaceReader) -> str | NDArray[np.float64]:
    if isinstance(weights, str):
        if weights not in ("area", "count"):
            raise ValueError(f"`weights` must be 'area', 'count' or an array; got {weights!r}")
        return weights
    given, n = np.asarray(weights, dtype=np.float64), reader.facts().n_facets
    if given.shape != (n,):
        raise ValueError(f"`weights` must have shape ({n},), one for each facet; got {given.shape}")
    if not (np.isfinite(given) & (given >= 0.0)).all():
        raise ValueError("`weights` must be finite and >= 0; got a value that is not")
    return given


def relaxed_region(reader: SurfaceReader, domain: Any) -> Domain:
    """Give the domain in which relaxed kernels of a stream lie: as asked for, else that of its kind of surface."""
    try:
        region = reader.domain(domain, RELAXED)
    except ValueError:  # a closed surface that lies in one plane, or nearly
        if domain is not None:
            raise
        region = reader.ball()
    assert region is not None  # the row has no ""
    return region


def streamed_violation(
    reader: SurfaceReader, points: NDArray[np.float64], weights: Any, threads: int
) -> NDArray[np.float64]:
    """Compute the share of a streamed surface that points do not face."""
    with workers_of(threads) as workers:
        return StreamedWeights(reader.by(workers), weights).violated(points) / UNITS
