"""`StreamedSurface`: a surface that need not fit in memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from voxkernel._notebook import InNotebooks
from voxkernel.large.surface_reader import SurfaceReader

__all__ = ["StreamedSurface"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StreamedSurface(InNotebooks):
    """A surface of triangles that is read in chunks, made by `stream_mesh`.

    Attributes
    ----------
    source : str
        Where it comes from.
    chunk_facets : int
        Facets that are held at a time.
    """

    _reader: SurfaceReader

    def __repr__(self) -> str:
        """Name the source."""
        n = self._reader.n_stored
        size = "" if n is None else f", {n:,} facets"
        return f"StreamedSurface({self.source}{size}, chunk_facets={self.chunk_facets})"

    def _more_rows(self) -> dict[str, Any]:
        n = self._reader.n_stored
        return {"source": self.source, "facets": None if n is None else f"{n:,}", "chunk facets": self.chunk_facets}

    @property
    def source(self) -> str:
        """Where it comes from."""
        return self._reader.name

    @property
    def chunk_facets(self) -> int:
        """Facets that are held at a time."""
        return self._reader.chunk_facets

    @property
    def n_facets(self) -> int:
        """Facets, those without area among them; read once if need be."""
        return self._reader.facts().n_facets

    @property
    def n_degenerate(self) -> int:
        """Facets without area; read once."""
        return len(self._reader.facts().degenerate)

    @property
    def bounds_volume(self) -> bool:
        """Whether the surface is closed and encloses a volume; read twice.

        Notes
        -----
        A closed surface is never taken for an open one. The other way round it may happen with a probability of
        about 2**-128: hashes of edges, added one way and taken off the other, would have to cancel by chance.
        """
        return self._reader.bounds_volume
