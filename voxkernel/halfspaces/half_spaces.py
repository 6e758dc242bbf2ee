"""From an oriented surface to the inner half-spaces of its facets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import frexp
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_depth, as_points, read_only
from voxkernel._core import (
    coplanar_groups,
    facet_planes,
    first_of_planes,
    mesh_planes,
)
from voxkernel._frozen import Frozen
from voxkernel.errors import MeshError
from voxkernel.halfspaces.integer_planes import (
    IntegerPlane,
    bits_of,
    dyadic_sum,
    explicit_plane,
    lattice_bits,
    ratios,
    to_float,
    triangle_plane,
    triangle_planes,
)
from voxkernel.halfspaces.local_frame import (
    LARGEST,
    THINNEST,
    LocalFrame,
    check_frame,
    power_of_two,
    settle_planes,
    span_space,
)
from voxkernel.mesh import TriangleMesh

__all__ = ["HalfSpaces"]

_EXPLICIT_ERROR = 32 * 2.0**-53
_NO_PLANES = read_only(np.empty((0, 4)))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class HalfSpaces(Frozen):
    """The inner half-spaces `n . x <= d` of a surface, ready for floating-point and exact work.

    Floating-point work happens in local coordinates `(x - origin) / scale`, in which every corner
    of the surface has length at most 1; exact work happens on integers made from the input doubles.

    Attributes
    ----------
    local_normals, local_offsets : (n, 3) and (n,) float64
        Unit normals and offsets in local coordinates.
    local_errors : (n,) float64
        The error of `n . x - d` at a local `x` is at most `local_errors * (|x| + 1)`.
    weights : (n,) float64
        Facet areas, in squared mesh units.
    facet_ids : (n,) int64
        The input facet of each half-space; `-1 - j` for the j-th plane given explicitly.
    origin, scale : (3,) float64 and float
        The local frame; `scale` is a power of two.
    n_degenerate : int
        Facets without area that were left out.
    bounds_volume : bool
        Whether the surface is closed and encloses a volume, so that the common part is bounded.
    is_triangulation : bool
        Whether the rows are the triangles of the surface, none left out.
    is_cone : bool
        Whether the planes of the surface were moved to the origin: directions, not points.

    Examples
    --------
    >>> import numpy as np
    >>> planes = HalfSpaces.from_planes([[1, 0, 0], [-1, 0, 0]], [2, 0])
    >>> planes.offsets
    array([2., 0.])
    """

    local_normals: NDArray[np.float64]
    local_offsets: NDArray[np.float64]
    local_errors: NDArray[np.float64]
    weights: NDArray[np.float64]
    facet_ids: NDArray[np.int64]
    origin: NDArray[np.float64]
    scale: float
    n_degenerate: int
    bounds_volume: bool
    _vertices: NDArray[np.float64]
    _corners: NDArray[np.int64]  # (n, 3) vertex ids; row (-1 - j, 0, 0) is explicit plane j
    _explicit: NDArray[np.float64]  # (k, 4) n, d as given
    _lattice_bits: int  # every input double times 2**bits is an integer
    is_triangulation: bool = False  # the rows are the triangles of the surface, none left out
    is_cone: bool = False  # the surface planes moved to the origin: directions, not points

    @classmethod
    def from_mesh(cls, mesh: TriangleMesh, *, threads: int = 1) -> HalfSpaces:
        """Build the half-spaces of a mesh; facets without area are dropped and counted.

        Parameters
        ----------
        mesh : TriangleMesh
            The surface; its facet planes are taken from the float64 corners as given.
        threads : int
            Threads, at least 1; the result does not depend on it.

        Returns
        -------
        HalfSpaces
            In facet order.

        Raises
        ------
        MeshError
            If no facet has an area, or the axes span too much or too little for doubles.
        TypeError, ValueError
            If `threads` is not an integer from 1 to 256.
        """
        return cls._from_spans(mesh, THINNEST, as_depth("threads", threads, 1, 256))

    @classmethod
    def _from_spans(cls, mesh: TriangleMesh, thinnest: float, threads: int = 1) -> HalfSpaces:
        """The same with another bound on spans; 0 is none, for callers that check what becomes of it."""
        vertices, corners = mesh.vertices, mesh.plane_corners
        (
            origin, scale, spans, largest, smallest, normals, offsets, areas, errors, undecided, refused, bounds_volume
        ) = mesh_planes(vertices, mesh.faces, corners, threads)  # fmt: skip
        check_frame(spans, largest, thinnest)
        bits = bits_of(smallest)
        n = len(corners)
        if undecided:
            is_open = errors == -1.0
            settle_planes(vertices, corners, LocalFrame(origin, scale, bits), normals, offsets, areas, errors)
            areas[is_open] *= scale**2
        keep = errors >= 0.0 if refused else None
        n_kept = n if keep is None else int(np.count_nonzero(keep))
        if n_kept == 0:
            raise MeshError(f"`mesh` must have a facet with positive area; got {n} facets without area")
        if mesh.plane_corners is not mesh.faces:
            areas = mesh.plane_areas.copy()
        facet_ids = mesh.plane_facets
        if keep is not None and n_kept < n:
            normals, offsets, areas, errors = normals[keep], offsets[keep], areas[keep], errors[keep]
            facet_ids, corners = read_only(facet_ids[keep]), read_only(corners[keep])
        if bounds_volume:
            exact = (triangle_plane(vertices, row, bits)[:3] for row in corners)
            bounds_volume = span_space(normals, exact)
        return cls(
            local_normals=read_only(normals),
            local_offsets=read_only(offsets),
            local_errors=read_only(errors),
            weights=read_only(areas),
            facet_ids=facet_ids,
            origin=origin,
            scale=scale,
            n_degenerate=n - n_kept,
            bounds_volume=bounds_volume,
            _vertices=vertices,
            _corners=corners,
            _explicit=_NO_PLANES,
            _lattice_bits=bits,
            is_triangulation=mesh.plane_corners is mesh.faces and n_kept == n,
        )

    @classmethod
    def _in_frame(cls, corners: NDArray[np.float64], facet_ids: NDArray[np.int64], frame: LocalFrame) -> HalfSpaces:
        """Build those of some triangles (m, 3, 3) of a surface in the frame of all of it: the same to the last bit.

        Triangles without area are left out and counted.
        """
        vertices = corners.reshape(-1, 3)
        ids = np.arange(len(vertices)).reshape(-1, 3)
        n = len(ids)
        normals, offsets, areas, errors = np.empty((n, 3)), np.empty(n), np.empty(n), np.empty(n)
        if facet_planes(vertices, ids, frame.origin, 1.0 / frame.scale, normals, offsets, areas, errors):
            settle_planes(vertices, ids, frame, normals, offsets, areas, errors)
        keep = errors >= 0.0
        if not keep.all():
            normals, offsets, areas, errors = normals[keep], offsets[keep], areas[keep], errors[keep]
            ids, facet_ids = ids[keep], facet_ids[keep]
        return cls(
            local_normals=normals,
            local_offsets=offsets,
            local_errors=errors,
            weights=areas * frame.scale**2,
            facet_ids=facet_ids,
            origin=frame.origin,
            scale=frame.scale,
            n_degenerate=n - len(ids),
            bounds_volume=False,
            _vertices=vertices,
            _corners=ids,
            _explicit=_NO_PLANES,
            _lattice_bits=frame.bits,
        )

    @classmethod
    def from_planes(cls, normals: ArrayLike, offsets: ArrayLike, *, weights: ArrayLike | None = None) -> HalfSpaces:
        """Build half-spaces `n . x <= d` from planes given as numbers; these doubles are exact.

        Parameters
        ----------
        normals : (n, 3) array_like
            Outward normals, of any length but zero.
        offsets : (n,) array_like
            Right-hand sides `d`.
        weights : (n,) array_like, optional
            Weight of each half-space; 1 by default.

        Returns
        -------
        HalfSpaces
            In the order given; `facet_ids` are 0 .. n - 1.

        Raises
        ------
        ValueError
            If the shapes do not match, a number is not finite, or a normal is zero.
        """
        rows = _as_plane_rows(normals, offsets)
        n = len(rows)
        if weights is None:
            weight_array = np.ones(n)
        else:
            weight_array = np.array(weights, dtype=np.float64)
            if weight_array.shape != (n,) or not (np.isfinite(weight_array) & (weight_array >= 0)).all():
                raise ValueError(f"`weights` must be {n} finite numbers >= 0; got {weights!r}")
        reach = float(np.max(np.abs(_unit_rows(rows)[1]), initial=0.0))
        empty = np.empty(0)
        nothing = cls(
            local_normals=np.empty((0, 3)),
            local_offsets=empty,
            local_errors=empty,
            weights=empty,
            facet_ids=np.empty(0, np.int64),
            origin=read_only(np.zeros(3)),
            scale=power_of_two(reach),
            n_degenerate=0,
            bounds_volume=False,
            _vertices=np.empty((0, 3)),
            _corners=np.empty((0, 3), np.int64),
            _explicit=np.empty((0, 4)),
            _lattice_bits=0,
        )
        return nothing._with_rows(rows, np.arange(n), weight_array)

    @property
    def normals(self) -> NDArray[np.float64]:
        """Unit outward normals, (n, 3)."""
        return self.local_normals

    @property
    def offsets(self) -> NDArray[np.float64]:
        """Offsets `d` in world coordinates, (n,): the half-space is `n . x <= d`."""
        return self.local_offsets * self.scale + self.local_normals @ self.origin

    def __len__(self) -> int:
        """Return the number of half-spaces."""
        return len(self.local_offsets)

    def __repr__(self) -> str:
        """Name the size and what was left out."""
        return f"HalfSpaces(n={len(self)}, n_degenerate={self.n_degenerate})"

    def select(self, ids: NDArray[Any]) -> HalfSpaces:
        """Keep the half-spaces `ids` (indices or mask), in that order."""
        return replace(
            self,
            local_normals=read_only(self.local_normals[ids]),
            local_offsets=read_only(self.local_offsets[ids]),
            local_errors=read_only(self.local_errors[ids]),
            weights=read_only(self.weights[ids]),
            facet_ids=read_only(self.facet_ids[ids]),
            bounds_volume=False,
            is_triangulation=False,
            _corners=read_only(self._corners[ids]),
        )

    def with_planes(self, normals: ArrayLike, offsets: ArrayLike) -> HalfSpaces:
        """Append explicit half-spaces of weight 0 in world coordinates; their facet ids are -1, -2, ..."""
        rows = _as_plane_rows(normals, offsets, most=16 * LARGEST)  # of a ball around the largest of surfaces
        return self._with_rows(rows, -1 - np.arange(len(rows)), np.zeros(len(rows)))

    def signs_with_planes(self, normals: ArrayLike, offsets: ArrayLike) -> HalfSpaces:
        """The same for whoever asks for signs only: it takes less memory, and there are neither weights nor ids."""
        bare = replace(self, weights=np.empty(0), facet_ids=np.empty(0, np.int64)).with_planes(normals, offsets)
        n = len(bare)
        nothing = np.broadcast_to(np.zeros(()), n), np.broadcast_to(np.zeros((), np.int64), n)
        return replace(bare, weights=nothing[0], facet_ids=nothing[1])

    def to_world(self, local: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map local points to world coordinates."""
        return local * self.scale + self.origin

    def to_local(self, world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Map world points to local coordinates."""
        return (world - self.origin) / self.scale

    def to_lattice(self, local: NDArray[np.float64]) -> tuple[Fraction, Fraction, Fraction]:
        """Map a local double point to exact lattice coordinates (world times 2**bits)."""
        unit, per_scale = self.scale.as_integer_ratio()
        unit <<= self._lattice_bits
        x, y, z = (
            dyadic_sum(v * unit, w * per_scale, o << self._lattice_bits, p)
            for (v, w), (o, p) in zip(ratios(local), ratios(self.origin), strict=True)
        )
        return x, y, z

    def from_lattice(self, point: Sequence[Fraction | int]) -> NDArray[np.float64]:
        """Round an exact lattice point to local coordinates; infinite beyond the range of doubles."""
        shift = 1 << self._lattice_bits
        inverse = 1 / Fraction(self.scale)
        return np.array(
            [
                to_float((Fraction(v) / shift - Fraction(float(o))) * inverse)
                for v, o in zip(point, self.origin, strict=True)
            ]
        )

    def lattice_to_world(self, point: Sequence[Fraction | int]) -> tuple[Fraction, Fraction, Fraction]:
        """Map an exact lattice point to exact world coordinates."""
        x, y, z = (Fraction(v.numerator, v.denominator << self._lattice_bits) for v in point)
        return x, y, z

    def world_to_lattice(self, point: Sequence[Fraction]) -> tuple[Fraction, Fraction, Fraction]:
        """Map an exact world point to exact lattice coordinates."""
        x, y, z = (Fraction(v.numerator << self._lattice_bits, v.denominator) for v in point)
        return x, y, z

    @property
    def lattice_unit(self) -> int:
        """Lattice units per world unit, a power of two."""
        return 1 << self._lattice_bits

    def integer_planes(self, ids: NDArray[Any] | Sequence[int]) -> list[IntegerPlane]:
        """Give planes exactly: integers (a, b, c, d) with `(a, b, c) . y <= d` in lattice coordinates y."""
        bits = self._lattice_bits
        plane_of = triangle_planes(self._vertices, bits)
        planes: list[IntegerPlane] = []
        for row in self._corners[np.asarray(ids, np.int64)].tolist():
            if row[0] < 0:
                planes.append(explicit_plane(self._explicit[-1 - row[0]], bits))
            else:
                a, b, c, d = plane_of(row)
                planes.append((a, b, c, 0 if self.is_cone else d))
        return planes

    def recession_cone(self) -> HalfSpaces:
        """Move all planes through the origin: the directions in which the common part never ends.

        Explicit half-spaces become exact cones too; planes appended later are taken as given.
        """
        explicit = self._explicit.copy()
        explicit[:, 3] = 0.0
        return replace(
            self,
            local_offsets=read_only(np.zeros(len(self))),
            origin=read_only(np.zeros(3)),
            scale=1.0,
            is_triangulation=False,
            is_cone=True,
            _explicit=read_only(explicit),
        )

    def coplanar_groups(self, *, threads: int = 1) -> NDArray[np.int64]:
        """Name for each half-space the first exactly coplanar one that faces the same way, (n,).

        Every pair is found, facets and explicit half-spaces alike, but for two things: where a number in use is
        beyond 2**-300 .. 2**300 nothing is grouped, and in a cone no facet is with an explicit half-space.
        Merging saves work, no answer depends on it.
        """
        count = as_depth("threads", threads, 1, 256)
        return coplanar_groups(self.local_normals, self._vertices, self._corners, self._explicit, self.is_cone, count)

    def first_of_planes(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Of ascending rows, the first on each plane, as `coplanar_groups` finds them."""
        return first_of_planes(self.local_normals, self._vertices, self._corners, self._explicit, self.is_cone, rows)

    def merged(self) -> HalfSpaces:
        """Merge exactly coplanar duplicates: the first one stays and takes the sum of the weights."""
        groups = self.coplanar_groups()
        heads = np.flatnonzero(groups == np.arange(len(self)))
        if len(heads) == len(self):
            return self
        weights = np.bincount(groups, weights=self.weights, minlength=len(self))[heads].astype(np.float64)
        return replace(self.select(heads), weights=read_only(weights), bounds_volume=self.bounds_volume)

    def corner_ids(self) -> NDArray[np.int64]:
        """Vertex ids of the corners that define each plane, (n, 3); negative rows are explicit planes."""
        return self._corners

    @property
    def vertices(self) -> NDArray[np.float64]:
        """The vertices `corner_ids` refer to, (v, 3), world coordinates."""
        return self._vertices

    def given_planes(self) -> NDArray[np.float64]:
        """The planes given as numbers, (k, 4): row j is n, d of the one that `corner_ids` calls -1 - j."""
        return self._explicit

    def _with_rows(
        self, rows: NDArray[np.float64], facet_ids: NDArray[np.int64], weights: NDArray[np.float64]
    ) -> HalfSpaces:
        unit, distance = _unit_rows(rows)
        local = (distance - unit @ self.origin) / self.scale
        size = (np.abs(distance) + np.linalg.norm(self.origin)) / self.scale
        errors = _EXPLICIT_ERROR * (1.0 + size)
        first = len(self._explicit)
        corners = np.zeros((len(rows), 3), np.int64)
        corners[:, 0] = -1 - first - np.arange(len(rows))
        return replace(
            self,
            local_normals=_joined(self.local_normals, unit),
            local_offsets=_joined(self.local_offsets, local),
            local_errors=_joined(self.local_errors, errors),
            weights=_joined(self.weights, weights),
            facet_ids=_joined(self.facet_ids, facet_ids),
            is_triangulation=False,
            _corners=_joined(self._corners, corners),
            _explicit=_joined(self._explicit, rows),
            _lattice_bits=max(self._lattice_bits, lattice_bits(rows)),
        )


def _joined(one: NDArray[Any], two: NDArray[Any]) -> NDArray[Any]:
    return read_only(np.concatenate([one, two]))


def _as_plane_rows(normals: ArrayLike, offsets: ArrayLike, *, most: float = LARGEST) -> NDArray[np.float64]:
    normal_array = as_points("normals", normals)
    offset_array = np.array(offsets, dtype=np.float64)
    if offset_array.shape != (len(normal_array),):
        raise ValueError(f"`offsets` must have shape ({len(normal_array)},); got {offset_array.shape}")
    if not np.isfinite(offset_array).all():
        raise ValueError("`offsets` must be finite; got NaN or infinity")
    zero = np.flatnonzero(~normal_array.any(axis=1))
    if zero.size:
        raise ValueError(f"`normals` must not be zero; got a zero normal in row {zero[0]}")
    rows = np.column_stack([normal_array, offset_array])
    far = np.flatnonzero(~(np.abs(_unit_rows(rows)[1]) <= most))
    if far.size:
        limit = f"2**{frexp(most)[1] - 1} times the length of their normal"
        raise ValueError(f"`offsets` must be at most {limit}; got row {far[0]} beyond")
    return rows


def _unit_rows(rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit normals and distances, scaled by powers of two first, so that no length leaves the range of doubles."""
    if not len(rows):
        return np.empty((0, 3)), np.empty(0)
    _, exponents = np.frexp(np.abs(rows[:, :3]).max(axis=1))
    with np.errstate(over="ignore"):
        scaled = rows / np.ldexp(1.0, exponents - 1)[:, None]
    lengths = np.linalg.norm(scaled[:, :3], axis=1)
    return scaled[:, :3] / lengths[:, None], scaled[:, 3] / lengths
