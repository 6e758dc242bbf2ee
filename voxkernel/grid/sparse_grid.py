"""`SparseGrid`: active voxels as tiles and 8^3 leaves, with an affine transform. Knows no geometry.

Conventions, said once for the whole library:

* ``ijk`` are integer voxel coordinates (any sign), ``xyz`` are world points.
* `origin` is the lower **corner** of voxel (0, 0, 0); the columns of `linear` are the voxel's edges. The
  centre of voxel ijk is ``origin + linear @ (ijk + 0.5)``. A kernel grid has ``linear = voxel_size *
  frame.T``.
* A leaf is 8^3 voxels, eight uint64 words: word = x, bit = y*8 + z. A tile is a cube of 2**log2 voxels,
  aligned to its size, all of them active and of one value.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any, Literal, Self, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_choice, as_points, read_only
from voxkernel._frozen import Frozen
from voxkernel.grid import build, cell_runs, query, set_operations
from voxkernel.grid.array_checks import (
    array_of,
    check_overlap,
    coordinates,
    frame_of,
    frozen,
    in_order,
    tiles_of,
)
from voxkernel.grid.cell_runs import Body, Cells
from voxkernel.grid.leaf_bits import bit_bounds, popcount
from voxkernel.grid.lookup import ActiveTable
from voxkernel.grid.morton import decode, encode, last_of

__all__ = ["SparseGrid"]

GridClass = Literal["unknown", "level set", "fog volume", "staggered"]
GRID_CLASSES = ("unknown", "level set", "fog volume", "staggered")

_set = object.__setattr__  # the dataclass is frozen for its users
_SAME_CELL = 1e-6  # two transforms agree when they differ by less than this part of a voxel's edge


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SparseGrid(Frozen):
    """Sparse set of active voxels, with one float value each if wanted, in OpenVDB's level structure.

    Tiles and leaves never overlap and are kept sorted along the Morton curve. Arrays are read-only. Build
    one with `from_ijk`, `from_points`, `from_dense` or `from_tiles_and_leaves`; change one with set
    operations, which return new grids. ``dataclasses.replace(grid, name="inside")`` renames. ``==`` and `hash`
    go by the voxels, their values and the transform, not by names and metadata.

    Parameters
    ----------
    tile_ijk : (T, 3) int32
        Lower corners of the tiles, multiples of their edge, in [-2**23, 2**23).
    tile_log2 : (T,) int8
        Edge of each tile is ``2**tile_log2`` voxels, 3 to 23.
    leaf_ijk : (L, 3) int32
        Lower corners of the leaves, multiples of 8.
    leaf_mask : (L, 8) uint64
        Active voxels of each leaf: word = x, bit = y*8 + z. May be all zero.
    tile_values : (T,) float32, optional
        Value of each tile; None (together with `leaf_values`) makes the grid a mask.
    leaf_values : (L, 512) float32, optional
        Values at x*64 + y*8 + z, of inactive voxels too.
    background : float, default 0
        Value of every voxel that no tile and no leaf covers. A mask has 0.
    origin : (3,) float64, default (0, 0, 0)
        World position of the lower corner of voxel (0, 0, 0).
    linear : (3, 3) float64, default identity
        Columns are the edges of a voxel in world units: voxel size times rotation, or any regular matrix.
    name : str, default ""
        Name in a file.
    grid_class : {"unknown", "level set", "fog volume", "staggered"}
        What the values mean to OpenVDB.
    metadata : mapping of str to bool, int, float, str or tuple, optional
        Written to files; copied, and read-only.
    inactive_ijk, inactive_log2, inactive_values : (I, 3) int32, (I,) int8, (I,) float32, optional
        Inactive tiles whose value is not the background, such as the inside of a level set. Only of float
        grids; kept by files, `values_at` and `to_dense`, dropped by set operations, not looked at by ``==``.

    Raises
    ------
    TypeError
        If an array has the wrong kind of dtype.
    ValueError
        If shapes, ranges or alignment are wrong, cells overlap, or `linear` is singular.

    Notes
    -----
    A tile costs 13 bytes and a leaf 76, whatever the number of active voxels. Set operations and queries cost
    O(c log c) in the number c of tiles and leaves: nested cells are runs of Morton codes [1]_, so that a
    tile is split only around the smaller cells inside it. The level structure is that of OpenVDB [2]_.

    References
    ----------
    .. [1] G. M. Morton, A computer oriented geodetic data base and a new technique in file sequencing,
       IBM, 1966.
    .. [2] K. Museth, VDB: High-resolution sparse volumes with dynamic topology, ACM Trans. Graph. 32(3),
       2013, doi:10.1145/2487228.2487235.

    Examples
    --------
    >>> import numpy as np
    >>> grid = SparseGrid.from_dense(np.ones((16, 16, 9), dtype=bool), voxel_size=0.5)
    >>> grid.active_voxel_count, grid.tile_count, grid.leaf_count
    (2304, 4, 4)
    >>> grid.is_active([[0, 0, 8], [0, 0, 9]])
    array([ True, False])
    >>> grid.index_to_world([[0, 0, 0]])
    array([[0.25, 0.25, 0.25]])
    """

    tile_ijk: NDArray[np.int32]
    tile_log2: NDArray[np.int8]
    leaf_ijk: NDArray[np.int32]
    leaf_mask: NDArray[np.uint64]
    tile_values: NDArray[np.float32] | None = None
    leaf_values: NDArray[np.float32] | None = None
    background: float = 0.0
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    linear: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))
    name: str = ""
    grid_class: GridClass = "unknown"
    metadata: Mapping[str, Any] = field(default_factory=dict)
    inactive_ijk: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int32))
    inactive_log2: NDArray[np.int8] = field(default_factory=lambda: np.zeros(0, dtype=np.int8))
    inactive_values: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, dtype=np.float32))
    _body: Body = field(init=False)
    _index: Cells | None = field(init=False, default=None)
    _table: ActiveTable | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        """Check everything once and bring cells into Morton order."""
        tiles = tiles_of("tile", self.tile_ijk, self.tile_log2)
        leaf_ijk = coordinates("leaf_ijk", self.leaf_ijk)
        if (leaf_ijk & 7).any():
            wrong = leaf_ijk[(leaf_ijk & 7).any(axis=1)][0]
            raise ValueError(f"`leaf_ijk` must be multiples of 8; got {wrong.tolist()}")
        leaf_mask = array_of("leaf_mask", self.leaf_mask, np.dtype(np.uint64), (len(leaf_ijk), 8))
        if (self.tile_values is None) != (self.leaf_values is None):
            raise ValueError("`tile_values` and `leaf_values` must be given together; got only one of them")
        tile_values = leaf_values = None
        if self.tile_values is not None:
            tile_values = array_of("tile_values", self.tile_values, np.dtype(np.float32), (len(tiles[0]),))
            leaf_values = array_of("leaf_values", self.leaf_values, np.dtype(np.float32), (len(leaf_ijk), 512))
        unsorted = Body(encode(tiles[0] >> 3), tiles[1], tile_values, encode(leaf_ijk >> 3), leaf_mask, leaf_values)
        body, tile_order, leaf_order = in_order(unsorted)
        _set(self, "tile_ijk", frozen(tiles[0] if tile_order is None else tiles[0][tile_order]))
        _set(self, "leaf_ijk", frozen(leaf_ijk if leaf_order is None else leaf_ijk[leaf_order]))
        self._adopt(body)
        index = self._cells()
        check_overlap(index)
        self._check_inactive(index)
        self._check_frame()

    def _adopt(self, body: Body) -> None:
        """Take over the arrays of `body`, read-only."""
        body = Body(*(None if array is None else frozen(array) for array in body))  # type: ignore[arg-type]
        for name in ("tile_log2", "tile_values", "leaf_mask", "leaf_values"):
            _set(self, name, getattr(body, name))
        _set(self, "_body", body)
        _set(self, "_index", None)
        _set(self, "_table", None)

    def _check_inactive(self, index: Cells) -> None:
        """Inactive tiles overlap nothing and make sense only beside values."""
        ijk, log2 = tiles_of("inactive", self.inactive_ijk, self.inactive_log2)
        values = array_of("inactive_values", self.inactive_values, np.dtype(np.float32), (len(ijk),))
        if len(ijk):
            if self.tile_values is None:
                raise ValueError("`inactive_ijk` must be empty in a mask; got values of inactive tiles")
            code = encode(ijk >> 3)
            order = np.argsort(code, kind="stable")
            ijk, log2, values, code = ijk[order], log2[order], values[order], code[order]
            check_overlap(index.with_runs(code, last_of(code, log2 - 3)))
        _set(self, "inactive_ijk", frozen(ijk))
        _set(self, "inactive_log2", frozen(log2))
        _set(self, "inactive_values", frozen(values))

    def _check_frame(self) -> None:
        """Transform, background and labels."""
        origin, linear = frame_of(self.origin, 1.0, self.linear)
        if not isinstance(cast(object, self.name), str):
            raise TypeError(f"`name` must be a str; got {type(self.name).__name__}")
        as_choice("grid_class", self.grid_class, GRID_CLASSES)
        background = np.float32(self.background)
        if self.tile_values is None and background != 0:
            raise ValueError(f"`background` must be 0 in a mask; got {background}")
        _set(self, "origin", read_only(origin))
        _set(self, "linear", read_only(linear))
        _set(self, "background", float(background))
        _set(self, "metadata", MappingProxyType(dict(self.metadata)))

    # -- constructors ------------------------------------------------------------------------------

    from_tiles_and_leaves = classmethod(build.from_tiles_and_leaves)
    from_ijk = classmethod(build.from_ijk)
    from_points = classmethod(build.from_points)
    from_dense = classmethod(build.from_dense)

    def _with(self, body: Body, metadata: Mapping[str, Any], **frame: Any) -> Self:
        """A grid around a sorted, valid body, without checking it again; inactive tiles are dropped."""
        grid = object.__new__(type(self))
        for name in ("background", "origin", "linear", "name", "grid_class"):
            _set(grid, name, frame.get(name, getattr(self, name)))
        _set(grid, "metadata", MappingProxyType(dict(metadata)))
        _set(grid, "tile_ijk", frozen(decode(body.tile_code) << 3))
        _set(grid, "leaf_ijk", frozen(decode(body.leaf_code) << 3))
        _set(grid, "inactive_ijk", frozen(np.zeros((0, 3), dtype=np.int32)))
        _set(grid, "inactive_log2", frozen(np.zeros(0, dtype=np.int8)))
        _set(grid, "inactive_values", frozen(np.zeros(0, dtype=np.float32)))
        grid._adopt(body)
        return grid

    def _reframed(self, **frame: Any) -> Self:
        """The same voxels, sharing every array, in another frame or under other labels, which are checked."""
        grid = object.__new__(type(self))
        for part in fields(self):
            _set(grid, part.name, frame.pop(part.name) if part.name in frame else getattr(self, part.name))
        grid._check_frame()
        return grid

    # -- what is in it -----------------------------------------------------------------------------

    def _cells(self) -> Cells:
        """Tiles and leaves as one sorted list, made when first needed."""
        if self._index is None:
            _set(self, "_index", Cells(*map(read_only, cell_runs.cells_of(self._body))))
        return cast(Cells, self._index)

    def _more_rows(self) -> dict[str, Any]:
        return {"active voxels": f"{self.active_voxel_count:,}"}

    @property
    def is_mask(self) -> bool:
        """Whether the grid holds no values, only active voxels."""
        return self.tile_values is None

    @property
    def tile_count(self) -> int:
        """Number of active tiles."""
        return len(self.tile_log2)

    @property
    def leaf_count(self) -> int:
        """Number of leaves, those without an active voxel included."""
        return len(self.leaf_ijk)

    @property
    def active_voxel_count(self) -> int:
        """Number of active voxels, exact however large."""
        log2, counts = np.unique(self.tile_log2, return_counts=True)
        in_tiles = sum(int(count) << (3 * int(exponent)) for exponent, count in zip(log2, counts, strict=True))
        return in_tiles + int(popcount(self.leaf_mask).sum())

    @property
    def active_bbox(self) -> NDArray[np.int64] | None:
        """Lowest and highest active voxel per axis, (2, 3) int64, both inclusive; None in an empty grid."""
        lows: list[NDArray[np.int64]] = []
        highs: list[NDArray[np.int64]] = []
        if self.tile_count:
            corners = self.tile_ijk.astype(np.int64)
            lows.append(corners.min(axis=0))
            highs.append((corners + (np.int64(1) << self.tile_log2.astype(np.int64))[:, None] - 1).max(axis=0))
        used = self.leaf_mask.any(axis=1)
        if used.any():
            masks, corners = self.leaf_mask[used], self.leaf_ijk[used]
            outer = ((corners == corners.min(axis=0)) | (corners == corners.max(axis=0))).any(axis=1)
            low, high = bit_bounds(masks[outer])
            lows.append((low + corners[outer]).min(axis=0))
            highs.append((high + corners[outer]).max(axis=0))
        if not lows:
            return None
        return np.stack([np.min(lows, axis=0), np.max(highs, axis=0)])

    @property
    def nbytes(self) -> int:
        """Bytes held by tiles and leaves (search index not counted)."""
        arrays = (
            self.tile_ijk,
            self.tile_log2,
            self.leaf_ijk,
            self.leaf_mask,
            self.tile_values,
            self.leaf_values,
        )
        return sum(array.nbytes for array in arrays if array is not None)

    is_active = query.is_active
    values_at = query.values_at
    to_ijk = query.to_ijk
    to_dense = query.to_dense
    points_in_grid = query.points_in_grid

    # -- index and world ---------------------------------------------------------------------------

    @property
    def voxel_size(self) -> float:
        """Edge of a voxel in world units; `ValueError` when the three edges differ (see `linear`)."""
        edges = np.linalg.norm(self.linear, axis=0)
        if np.ptp(edges) > _SAME_CELL * edges.max():
            raise ValueError(f"`voxel_size` must be asked only of a uniform grid; got edges {edges.tolist()}")
        return float(edges[0])

    @property
    def voxel_volume(self) -> float:
        """Volume of a voxel in world units cubed."""
        return float(abs(np.linalg.det(self.linear)))

    @property
    def transform(self) -> NDArray[np.float64]:
        """(4, 4) matrix from index (an integer is a voxel's centre) to world: ``xyz1 = transform @ ijk1``."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.linear
        matrix[:3, 3] = self.origin + self.linear @ np.full(3, 0.5)
        return matrix

    def index_to_world(self, ijk: ArrayLike) -> NDArray[np.float64]:
        """World points of index coordinates; integers are voxel centres.

        Parameters
        ----------
        ijk : (n, 3) int or float
            Index coordinates.

        Returns
        -------
        (n, 3) float64
            ``origin + linear @ (ijk + 0.5)``.

        Raises
        ------
        TypeError, ValueError
            If `ijk` is not finite real (n, 3).

        Examples
        --------
        >>> SparseGrid.from_ijk([[0, 0, 0]], voxel_size=2).index_to_world([[-0.5, 0, 1]])
        array([[0., 1., 3.]])
        """
        return (as_points("ijk", ijk) + 0.5) @ self.linear.T + self.origin

    def world_to_index(self, xyz: ArrayLike) -> NDArray[np.float64]:
        """Index coordinates of world points; the inverse of `index_to_world`.

        Parameters
        ----------
        xyz : (n, 3) float64
            World points.

        Returns
        -------
        (n, 3) float64
            Not rounded; a point belongs to voxel ``floor(index + 0.5)``.

        Raises
        ------
        TypeError, ValueError
            If `xyz` is not finite real (n, 3).

        Examples
        --------
        >>> SparseGrid.from_ijk([[0, 0, 0]], voxel_size=2).world_to_index([[1, 1, 3]])
        array([[0., 0., 1.]])
        """
        return (as_points("xyz", xyz) - self.origin) @ np.linalg.inv(self.linear).T - 0.5

    # -- set operations ----------------------------------------------------------------------------

    union = set_operations.union
    intersection = set_operations.intersection
    difference = set_operations.difference
    prune = set_operations.prune
    to_mask = set_operations.to_mask
    coarsened = set_operations.coarsened

    def _check_partner(self, other: object) -> None:
        """Set operations need the same voxels on both sides."""
        if not isinstance(other, SparseGrid):
            raise TypeError(f"`other` must be a SparseGrid; got {type(other).__name__}")
        to_cells = np.asarray(np.linalg.inv(self.linear), dtype=np.float64)
        shift = np.abs(to_cells @ (other.origin - self.origin)).max()
        turn = np.abs(to_cells @ other.linear - np.eye(3)).max()
        if max(shift, turn) > _SAME_CELL:
            raise ValueError("`other` must have the same transform; got another `origin` or `linear`")

    def __eq__(self, other: object) -> bool:
        """Same active voxels, values and transform, however they are split into tiles and leaves."""
        if not isinstance(other, SparseGrid):
            return NotImplemented
        if self.is_mask != other.is_mask:
            return False
        if not (np.array_equal(self.origin, other.origin) and np.array_equal(self.linear, other.linear)):
            return False
        mine, theirs = cell_runs.canonical(self._body), cell_runs.canonical(other._body)
        return all(_same(one, two) for one, two in zip(mine, theirs, strict=True))

    def __hash__(self) -> int:
        """Of what equal grids share and is cheap to count."""
        frame = *self.origin.tolist(), *self.linear.ravel().tolist()
        return hash((self.is_mask, self.active_voxel_count, frame))

    def __repr__(self) -> str:
        count, tiles, leaves = self.active_voxel_count, self.tile_count, self.leaf_count
        kind = "mask" if self.is_mask else "float"
        stored = f"{tiles} tile{'s' * (tiles != 1)}, {leaves} {'leaf' if leaves == 1 else 'leaves'}"
        return f"SparseGrid({self.name!r}, {count} active voxel{'s' * (count != 1)}, {stored}, {kind})"


def _same(one: NDArray[Any] | None, two: NDArray[Any] | None) -> bool:
    """Equal arrays, or both missing; NaN equals NaN."""
    if one is None or two is None:
        return one is two
    return np.array_equal(one, two, equal_nan=one.dtype == np.float32)
