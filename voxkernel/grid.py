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
from typing import Any, Literal, Self, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel import _cells
from voxkernel._cells import Body, Cells
from voxkernel._checks import as_choice, as_points, read_only
from voxkernel._grid_build import blocks_from_dense, dense_from_body, expanded, leaves_from_voxels
from voxkernel._grid_checks import (
    array_of,
    check_overlap,
    coordinates,
    frame_of,
    frozen,
    in_order,
    integers,
    linear_of,
    tiles_of,
)
from voxkernel._grid_query import MAX_TABLE, ActiveTable, find_rows, points_in, voxels_in
from voxkernel._leaf_bits import bit_bounds, popcount
from voxkernel._morton import REACH, decode, encode, last_of

__all__ = ["SparseGrid"]

GridClass = Literal["unknown", "level set", "fog volume", "staggered"]
GRID_CLASSES = ("unknown", "level set", "fog volume", "staggered")

_set = object.__setattr__  # the dataclass is frozen for its users
_MIN_TABLE_QUERIES = 1 << 16
_SAME_CELL = 1e-6  # two transforms agree when they differ by less than this part of a voxel's edge


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SparseGrid:
    """Sparse set of active voxels, with one float value each if wanted, in OpenVDB's level structure.

    Tiles and leaves never overlap and are kept sorted along the Morton curve. Arrays are read-only. Build
    one with `from_ijk`, `from_points`, `from_dense` or `from_tiles_and_leaves`; change one with set
    operations, which return new grids. ``dataclasses.replace(grid, name="inside")`` renames.

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
        Written to files; copied.
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
        _set(self, "metadata", dict(self.metadata))

    # -- constructors ------------------------------------------------------------------------------

    @classmethod
    def from_tiles_and_leaves(
        cls,
        tile_ijk: ArrayLike,
        tile_log2: ArrayLike,
        leaf_ijk: ArrayLike,
        leaf_mask: ArrayLike,
        *,
        tile_values: ArrayLike | None = None,
        leaf_values: ArrayLike | None = None,
        background: float = 0.0,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        voxel_size: float = 1.0,
        linear: ArrayLike | None = None,
        name: str = "",
        grid_class: GridClass = "unknown",
        metadata: Mapping[str, Any] | None = None,
    ) -> Self:
        """Grid from arrays that are already tiles and leaves; checks them and shares their memory.

        Parameters
        ----------
        tile_ijk, tile_log2 : (T, 3) int32, (T,) int8
            Aligned cubes of ``2**tile_log2`` active voxels.
        leaf_ijk, leaf_mask : (L, 3) int32, (L, 8) uint64
            Leaves and their active voxels.
        tile_values, leaf_values : (T,) float32, (L, 512) float32, optional
            Values of a float grid.
        background : float, default 0
            Value outside tiles and leaves.
        origin : (3,) float64
            Lower corner of voxel (0, 0, 0) in world units.
        voxel_size : float, default 1
            Edge of a voxel; used when `linear` is not given.
        linear : (3, 3) float64, optional
            Edges of a voxel as columns; wins over `voxel_size`.
        name, grid_class, metadata : str, str, mapping, optional
            See the class.

        Returns
        -------
        SparseGrid
            Empty arrays give an empty grid. Arrays already in Morton order are not copied.

        Raises
        ------
        TypeError, ValueError
            As for the class.

        Examples
        --------
        >>> import numpy as np
        >>> masks = np.zeros((1, 8), dtype=np.uint64)
        >>> masks[0, 2] = 1 << 9  # x = 2, y = 1, z = 1
        >>> grid = SparseGrid.from_tiles_and_leaves([[0, 0, 0]], [4], [[-8, 0, 0]], masks)
        >>> grid.active_voxel_count
        4097
        >>> grid.active_bbox.tolist()
        [[-6, 0, 0], [15, 15, 15]]
        """
        return cls(
            cast(NDArray[np.int32], tile_ijk),
            cast(NDArray[np.int8], tile_log2),
            cast(NDArray[np.int32], leaf_ijk),
            cast(NDArray[np.uint64], leaf_mask),
            cast("NDArray[np.float32] | None", tile_values),
            cast("NDArray[np.float32] | None", leaf_values),
            background=background,
            origin=cast(NDArray[np.float64], origin),
            linear=linear_of(voxel_size, linear),
            name=name,
            grid_class=grid_class,
            metadata=metadata or {},
        )

    @classmethod
    def from_ijk(
        cls,
        ijk: ArrayLike,
        *,
        values: ArrayLike | None = None,
        background: float = 0.0,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        voxel_size: float = 1.0,
        linear: ArrayLike | None = None,
        name: str = "",
    ) -> Self:
        """Grid with the listed voxels active; full leaves become tiles.

        Parameters
        ----------
        ijk : (n, 3) int
            Voxel coordinates; repeats are allowed.
        values : (n,) float32, optional
            Value of each voxel; of repeats the last one counts.
        background, origin, voxel_size, linear, name
            See `from_tiles_and_leaves`.

        Returns
        -------
        SparseGrid
            n = 0 gives an empty grid.

        Raises
        ------
        TypeError, ValueError
            If `ijk` is not integer (n, 3) within [-2**23, 2**23), or `values` has another length.

        Examples
        --------
        >>> SparseGrid.from_ijk([[0, 0, 0], [-1, 0, 0], [0, 0, 0]]).active_voxel_count
        2
        """
        voxels = coordinates("ijk", ijk)
        given = None if values is None else array_of("values", values, np.dtype(np.float32), (len(voxels),))
        leaf_code, leaf_mask, leaf_values = leaves_from_voxels(voxels, given, background)
        return cls._from_leaves(
            leaf_code, leaf_mask, leaf_values, background, frame_of(origin, voxel_size, linear), name
        )

    @classmethod
    def from_points(
        cls,
        xyz: ArrayLike,
        *,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        voxel_size: float = 1.0,
        linear: ArrayLike | None = None,
        name: str = "",
    ) -> Self:
        """Mask of the voxels in which at least one point lies.

        Parameters
        ----------
        xyz : (n, 3) float64
            Finite world points. A point on a shared face belongs to the voxel above it.
        origin, voxel_size, linear, name
            See `from_tiles_and_leaves`.

        Returns
        -------
        SparseGrid
            n = 0 gives an empty grid.

        Raises
        ------
        TypeError, ValueError
            If `xyz` is not finite real (n, 3), or a point lies beyond voxel +-2**23.

        Examples
        --------
        >>> SparseGrid.from_points([[0.1, 0.1, 0.1], [-0.1, 0.1, 0.1]], voxel_size=0.5).to_ijk().tolist()
        [[-1, 0, 0], [0, 0, 0]]
        """
        points = as_points("xyz", xyz)
        frame_origin, frame_linear = frame_of(origin, voxel_size, linear)
        cells = np.floor((points - frame_origin) @ np.linalg.inv(frame_linear).T)
        if len(cells) and np.abs(cells).max() > REACH:
            raise ValueError(f"`xyz` must lie within {REACH} voxels of `origin`; use a larger `voxel_size`")
        return cls.from_ijk(cells.astype(np.int64), origin=frame_origin, linear=frame_linear, name=name)

    @classmethod
    def from_dense(
        cls,
        array: ArrayLike,
        *,
        lower: ArrayLike = (0, 0, 0),
        background: float = 0.0,
        origin: ArrayLike = (0.0, 0.0, 0.0),
        voxel_size: float = 1.0,
        linear: ArrayLike | None = None,
        name: str = "",
    ) -> Self:
        """Grid from a dense array indexed [i, j, k].

        Parameters
        ----------
        array : (nx, ny, nz) bool or float
            bool gives a mask; numbers give a float grid whose active voxels are those unlike `background`.
        lower : (3,) int, default (0, 0, 0)
            Voxel of ``array[0, 0, 0]``.
        background, origin, voxel_size, linear, name
            See `from_tiles_and_leaves`.

        Returns
        -------
        SparseGrid
            In the form of `prune`: cubes of one value are tiles.

        Raises
        ------
        TypeError, ValueError
            If `array` is not three-dimensional bool or real, or reaches beyond +-2**23.

        Examples
        --------
        >>> import numpy as np
        >>> grid = SparseGrid.from_dense(np.eye(3)[None], lower=(-1, 0, 0))
        >>> grid.values_at([[-1, 1, 1], [-1, 1, 2]])
        array([1., 0.], dtype=float32)
        """
        dense = np.asarray(array)
        if dense.ndim != 3 or dense.dtype.kind not in "bfiu":
            raise ValueError(f"`array` must be bool or real (nx, ny, nz); got {dense.dtype} {dense.shape}")
        corner = coordinates("lower", np.reshape(np.asarray(lower), (1, -1)))[0]
        if (corner + dense.shape > REACH).any():
            raise ValueError(f"`array` must end below voxel {REACH}; got shape {dense.shape} from {corner.tolist()}")
        leaf_code, leaf_mask, leaf_values = blocks_from_dense(dense, corner, np.float32(background))
        return cls._from_leaves(
            leaf_code, leaf_mask, leaf_values, background, frame_of(origin, voxel_size, linear), name
        )

    @classmethod
    def _from_leaves(
        cls,
        leaf_code: NDArray[np.int64],
        leaf_mask: NDArray[np.uint64],
        leaf_values: NDArray[np.float32] | None,
        background: float,
        frame: tuple[NDArray[np.float64], NDArray[np.float64]],
        name: str,
    ) -> Self:
        """Pruned grid from leaves with sorted codes."""
        no_values = None if leaf_values is None else np.zeros(0, dtype=np.float32)
        body = Body(np.zeros(0, np.int64), np.zeros(0, np.int8), no_values, leaf_code, leaf_mask, leaf_values)
        empty = cls(
            np.zeros((0, 3), np.int32),
            np.zeros(0, np.int8),
            np.zeros((0, 3), np.int32),
            np.zeros((0, 8), np.uint64),
            no_values,
            None if leaf_values is None else np.zeros((0, 512), dtype=np.float32),
            background=background,
            origin=frame[0],
            linear=frame[1],
            name=name,
        )
        return empty._with(_cells.merged(body), {})

    def _with(self, body: Body, metadata: Mapping[str, Any], **frame: Any) -> Self:
        """A grid around a sorted, valid body, without checking it again; inactive tiles are dropped."""
        grid = object.__new__(type(self))
        for name in ("background", "origin", "linear", "name", "grid_class"):
            _set(grid, name, frame.get(name, getattr(self, name)))
        _set(grid, "metadata", dict(metadata))
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
            _set(self, "_index", _cells.cells_of(self._body))
        return cast(Cells, self._index)

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

    def is_active(self, ijk: ArrayLike) -> NDArray[np.bool_]:
        """Tell which voxels are active.

        Parameters
        ----------
        ijk : (n, 3) int
            Voxel coordinates; any integers, those beyond +-2**23 are not active.

        Returns
        -------
        (n,) bool
            Empty for n = 0.

        Raises
        ------
        TypeError, ValueError
            If `ijk` is not an integer (n, 3) array.

        Notes
        -----
        O(n log c) for c tiles and leaves. A long list about a compact grid is answered from a table of its
        8^3 blocks, made once: at most 16 MB, and never longer than the list.

        Examples
        --------
        >>> SparseGrid.from_ijk([[-3, 0, 5]]).is_active([[-3, 0, 5], [3, 0, 5]])
        array([ True, False])
        """
        voxels = integers("ijk", ijk)
        return voxels_in(voxels, self._table_for(len(voxels)), self._cells(), self.leaf_mask)

    def _table_for(self, n_queries: int) -> ActiveTable | None:
        """The faster way to ask this often: a table, made once, unless it is longer than the list."""
        if self._table is None and n_queries >= _MIN_TABLE_QUERIES:
            index = self._cells()
            if 0 < ActiveTable.size_of(index.code, index.last) <= min(n_queries, MAX_TABLE):
                _set(self, "_table", ActiveTable.build(*index, self.leaf_mask))
        return self._table

    def _rows(self, voxels: NDArray[np.integer]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Row of the leaf (or ``~row`` of the tile) that covers each voxel, and whether there is one."""
        index = self._cells()
        place, found = find_rows(index.code, index.last, voxels)
        return (index.row[place] if len(index.row) else place), found

    def values_at(self, ijk: ArrayLike) -> NDArray[np.float32]:
        """Values of voxels, active or not.

        Parameters
        ----------
        ijk : (n, 3) int
            Voxel coordinates.

        Returns
        -------
        (n,) float32
            `background` where nothing is stored; 1 and 0 in a mask.

        Raises
        ------
        TypeError, ValueError
            If `ijk` is not an integer (n, 3) array.

        Examples
        --------
        >>> grid = SparseGrid.from_ijk([[0, 0, 0]], values=[2.5], background=-1)
        >>> grid.values_at([[0, 0, 0], [0, 0, 1], [99, 0, 0]])
        array([ 2.5, -1. , -1. ], dtype=float32)
        """
        if self.tile_values is None or self.leaf_values is None:
            return self.is_active(ijk).astype(np.float32)
        voxels = integers("ijk", ijk)
        values = np.full(len(voxels), self.background, dtype=np.float32)
        rows, found = self._rows(voxels)
        is_leaf, is_tile = found & (rows >= 0), found & (rows < 0)
        at = voxels[is_leaf] & 7
        values[is_leaf] = self.leaf_values[rows[is_leaf], at[:, 0] * 64 + at[:, 1] * 8 + at[:, 2]]
        values[is_tile] = self.tile_values[~rows[is_tile]]
        if len(self.inactive_log2):
            code = encode(self.inactive_ijk >> 3)
            place, found = find_rows(code, last_of(code, self.inactive_log2 - 3), voxels)
            values[found] = self.inactive_values[place[found]]
        return values

    def to_ijk(self, *, max_voxels: int = 50_000_000) -> NDArray[np.int32]:
        """List the active voxels.

        Parameters
        ----------
        max_voxels : int, default 50 million
            Refuse to expand more than this (12 bytes each).

        Returns
        -------
        (n, 3) int32
            In Morton order of the tiles and leaves, lexicographic within each; (0, 3) for an empty grid.

        Raises
        ------
        ValueError
            If there are more than `max_voxels` active voxels.

        Examples
        --------
        >>> SparseGrid.from_ijk([[1, 0, 0], [0, 0, 7]]).to_ijk().tolist()
        [[0, 0, 7], [1, 0, 0]]
        """
        count = self.active_voxel_count
        if count > max_voxels:
            raise ValueError(f"`max_voxels` must be at least the {count} active voxels to list them; got {max_voxels}")
        return expanded(self._cells(), self.tile_ijk, self.tile_log2, (self.leaf_ijk, self.leaf_mask))

    def to_dense(self, bbox: ArrayLike | None = None, *, max_voxels: int = 1 << 30) -> NDArray[Any]:
        """Dense array of a box of voxels.

        Parameters
        ----------
        bbox : (2, 3) int, optional
            Lowest and highest voxel, inclusive; default `active_bbox`.
        max_voxels : int, default 2**30
            Refuse to make a larger array.

        Returns
        -------
        (nx, ny, nz) bool or float32
            Activity of a mask, values of a float grid (`background` where nothing is stored). (0, 0, 0) for
            an empty grid without `bbox`.

        Raises
        ------
        ValueError
            If `bbox` is not an integer (2, 3) array with low <= high + 1, or larger than `max_voxels`.

        Examples
        --------
        >>> SparseGrid.from_ijk([[0, 0, 0], [0, 0, 2]]).to_dense().astype(int).tolist()
        [[[1, 0, 1]]]
        """
        if bbox is None:
            bbox = self.active_bbox
        box = np.array([[0, 0, 0], [-1, -1, -1]]) if bbox is None else integers("bbox", bbox)
        if box.shape != (2, 3):
            raise ValueError(f"`bbox` must have shape (2, 3); got {box.shape}")
        low, high = (tuple(int(c) for c in row) for row in box)
        shape = tuple(h - m + 1 for m, h in zip(low, high, strict=True))
        if min(shape) < 0:
            raise ValueError(f"`bbox` must have low <= high + 1; got {box.tolist()}")
        if shape[0] * shape[1] * shape[2] > max_voxels:
            raise ValueError(f"`max_voxels` must be at least {shape[0] * shape[1] * shape[2]} for this `bbox`")
        off = (self.inactive_ijk, self.inactive_log2, self.inactive_values)
        corners = (self.tile_ijk, self.leaf_ijk)
        return dense_from_body(self._body, corners, off, np.array(low), shape, self.background)

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

    def points_in_grid(self, xyz: ArrayLike) -> NDArray[np.bool_]:
        """Tell which world points lie in an active voxel.

        Parameters
        ----------
        xyz : (n, 3) float64
            World points. A point on a shared face belongs to the voxel above it.

        Returns
        -------
        (n,) bool
            Empty for n = 0.

        Raises
        ------
        TypeError, ValueError
            If `xyz` is not finite real (n, 3).

        Examples
        --------
        >>> SparseGrid.from_ijk([[0, 0, 0]], voxel_size=0.5).points_in_grid([[0.4, 0, 0], [0.5, 0, 0]])
        array([ True, False])
        """
        points = as_points("xyz", xyz)
        to_cells = np.asarray(np.linalg.inv(self.linear), dtype=np.float64)
        return points_in(
            points, self.origin, to_cells, self._table_for(len(points)), self._cells(), self.leaf_mask
        )

    # -- set operations ----------------------------------------------------------------------------

    def union(self, other: "SparseGrid") -> Self:
        """Voxels active in either grid; where both are, the values of this one hold.

        Parameters
        ----------
        other : SparseGrid
            Same transform, and a mask if and only if this one is.

        Returns
        -------
        SparseGrid
            With this grid's transform, background and name; metadata and inactive tiles are dropped.

        Raises
        ------
        TypeError
            If `other` is not a SparseGrid or holds values where this one does not.
        ValueError
            If the transforms differ.

        Examples
        --------
        >>> a, b = SparseGrid.from_ijk([[0, 0, 0]]), SparseGrid.from_ijk([[0, 0, 1]])
        >>> a.union(b).to_ijk().tolist()
        [[0, 0, 0], [0, 0, 1]]
        """
        self._check_partner(other)
        if self.is_mask != other.is_mask:
            raise TypeError("`other` must be a mask like this grid, or hold values like it; got one of each")
        return self._with(_cells.union(self._body, other._body, self._cells(), other._cells()), {})

    def intersection(self, other: "SparseGrid") -> Self:
        """Voxels active in both grids, with the values of this one.

        Parameters
        ----------
        other : SparseGrid
            Same transform; may be a mask where this one holds values, and the reverse.

        Returns
        -------
        SparseGrid
            With this grid's transform, background and name; metadata and inactive tiles are dropped.

        Raises
        ------
        TypeError
            If `other` is not a SparseGrid.
        ValueError
            If the transforms differ.

        Examples
        --------
        >>> a, b = SparseGrid.from_ijk([[0, 0, 0], [0, 0, 1]]), SparseGrid.from_ijk([[0, 0, 1]])
        >>> a.intersection(b).to_ijk().tolist()
        [[0, 0, 1]]
        """
        self._check_partner(other)
        return self._with(_cells.intersection(self._body, other._body, self._cells(), other._cells()), {})

    def difference(self, other: "SparseGrid") -> Self:
        """Voxels active in this grid and not in the other, with the values of this one.

        Parameters
        ----------
        other : SparseGrid
            Same transform; may be a mask where this one holds values, and the reverse.

        Returns
        -------
        SparseGrid
            With this grid's transform, background and name; metadata and inactive tiles are dropped.

        Raises
        ------
        TypeError
            If `other` is not a SparseGrid.
        ValueError
            If the transforms differ.

        Examples
        --------
        >>> a, b = SparseGrid.from_ijk([[0, 0, 0], [0, 0, 1]]), SparseGrid.from_ijk([[0, 0, 1]])
        >>> a.difference(b).to_ijk().tolist()
        [[0, 0, 0]]
        """
        self._check_partner(other)
        return self._with(_cells.difference(self._body, other._body, self._cells(), other._cells()), {})

    def _check_partner(self, other: object) -> None:
        """Set operations need the same voxels on both sides."""
        if not isinstance(other, SparseGrid):
            raise TypeError(f"`other` must be a SparseGrid; got {type(other).__name__}")
        to_cells = np.asarray(np.linalg.inv(self.linear), dtype=np.float64)
        shift = np.abs(to_cells @ (other.origin - self.origin)).max()
        turn = np.abs(to_cells @ other.linear - np.eye(3)).max()
        if max(shift, turn) > _SAME_CELL:
            raise ValueError("`other` must have the same transform; got another `origin` or `linear`")

    def prune(self) -> Self:
        """Same voxels and values in the fewest tiles and leaves: the form in which equal grids have equal
        arrays.

        Returns
        -------
        SparseGrid
            Leaves without an active voxel and inactive tiles are dropped; name and metadata are kept.

        Examples
        --------
        >>> import numpy as np
        >>> full = np.full((8, 8), 2**64 - 1, dtype=np.uint64)
        >>> corners = np.indices((2, 2, 2)).reshape(3, 8).T * 8
        >>> SparseGrid.from_tiles_and_leaves([], [], corners, full).prune()
        SparseGrid('', 4096 active voxels, 1 tile, 0 leaves, mask)
        """
        return self._with(_cells.merged(self._body), self.metadata)

    def to_mask(self) -> Self:
        """The active voxels alone, without values.

        Returns
        -------
        SparseGrid
            A mask that shares this grid's arrays; inactive tiles are dropped, name and metadata are kept.

        Examples
        --------
        >>> SparseGrid.from_ijk([[0, 0, 0]], values=[2.5], name="v").to_mask()
        SparseGrid('v', 1 active voxel, 0 tiles, 1 leaf, mask)
        """
        return self._with(self._body._replace(tile_values=None, leaf_values=None), self.metadata, background=0.0)

    def coarsened(self, *, rule: Literal["any", "all"] = "any") -> Self:
        """Merge blocks of 2^3 voxels into one voxel of twice the edge.

        Parameters
        ----------
        rule : {"any", "all"}, default "any"
            A coarse voxel is active if any or if all of its eight voxels are.

        Returns
        -------
        SparseGrid
            Same origin, `linear` doubled; values are the mean of the active ones. Metadata and inactive
            tiles are dropped.

        Raises
        ------
        ValueError
            If `rule` is another word.

        Examples
        --------
        >>> grid = SparseGrid.from_ijk([[0, 0, 0], [-1, 0, 0], [-2, 1, 1]])
        >>> grid.coarsened().to_ijk().tolist(), grid.coarsened().voxel_size
        ([[-1, 0, 0], [0, 0, 0]], 2.0)
        """
        as_choice("rule", rule, ("any", "all"))
        return self._with(_cells.coarsen(self._body, rule), {}, linear=read_only(self.linear * 2.0))

    def __eq__(self, other: object) -> bool:
        """Same active voxels, values and transform, however they are split into tiles and leaves."""
        if not isinstance(other, SparseGrid):
            return NotImplemented
        if self.is_mask != other.is_mask:
            return False
        if not (np.array_equal(self.origin, other.origin) and np.array_equal(self.linear, other.linear)):
            return False
        mine, theirs = _cells.canonical(self._body), _cells.canonical(other._body)
        return all(_same(one, two) for one, two in zip(mine, theirs, strict=True))

    __hash__ = None  # type: ignore[assignment]

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
