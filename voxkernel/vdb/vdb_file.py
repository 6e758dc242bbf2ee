"""`SparseGrid` <-> .vdb files, readable by OpenVDB and all that is built on it. Needs NumPy only.

Owns the half-voxel shift: OpenVDB puts index 0 at the centre of a voxel, `SparseGrid.origin` is a corner.
"""

import os
import struct
import uuid
import warnings
from collections.abc import Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_choice
from voxkernel._frozen import Frozen
from voxkernel._input_file import input_file
from voxkernel._output_file import whole_file
from voxkernel.errors import GridReadError
from voxkernel.grid import NamedGrids, SparseGrid
from voxkernel.grid.sparse_grid import GRID_CLASSES
from voxkernel.vdb.file_format import (
    BLOSC,
    MAGIC,
    MASKED,
    VERSION,
    VERSIONS,
    ZIP,
    Source,
    UnsupportedGridError,
    pack_map,
    pack_metadata,
    pack_text,
    read_map,
    read_metadata,
)
from voxkernel.vdb.read_tree import Tree, leaf_numbers, read_tree
from voxkernel.vdb.write_tree import write_tree

__all__ = ["VdbFile", "read_vdb", "write_vdb"]

ValueType = Literal["bool", "mask", "float", "half"]
Compression = Literal["none", "zip", "blosc"]

_TREES: dict[str, ValueType] = {
    "Tree_bool_5_4_3": "bool",
    "Tree_mask_5_4_3": "mask",
    "Tree_float_5_4_3": "float",
    "Tree_float_5_4_3_HalfFloat": "half",
}
_TREE_NAMES = {kind: name for name, kind in _TREES.items()}
_FLAGS = {"none": MASKED, "zip": MASKED | ZIP, "blosc": MASKED | BLOSC}
_FLAG_NAMES = {"none": "active values", "zip": "zip + active values", "blosc": "blosc + active values"}
_SEPARATOR = "\x1e"  # between a grid's name and the number that makes it unique in its file
_ORIGIN = "voxkernel_origin"
# What a file says about the grid itself; made anew when a grid is written, hence not kept as metadata.
_DERIVED = {
    "class",
    "name",
    "file_bbox_min",
    "file_bbox_max",
    "file_voxel_count",
    "file_mem_bytes",
    "file_compression",
    "is_saved_as_half_float",
    _ORIGIN,
}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class VdbFile(Frozen):
    """What a .vdb file holds: its grids in order, and what could not be read.

    Iterating, indexing with a number and ``len`` go to the grids; indexing with a name finds the first grid
    of that name.

    Parameters
    ----------
    grids : tuple of SparseGrid
        Grids of bool, mask and float type.
    value_types : tuple of str
        How each grid is stored: "bool", "mask", "float" or "half".
    metadata : mapping
        Metadata of the file; that of a grid is ``grid.metadata``.
    skipped : tuple of str
        Name and reason of each grid that was left out.
    version : int
        File version, 222 to 225.
    library_version : tuple of int
        Version of the library that wrote the file.
    entries : tuple of mapping
        All that the file says about each grid, also what `SparseGrid` has no place for (compression, counts).

    Raises
    ------
    KeyError
        When indexed with a name that no grid has.

    Examples
    --------
    >>> import os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "a.vdb")
    >>> write_vdb(path, SparseGrid.from_ijk([[0, 0, 0]], name="inside"), metadata={"alpha": 0.03})
    >>> file = read_vdb(path)
    >>> file["inside"].active_voxel_count, dict(file.metadata), file.value_types
    (1, {'alpha': 0.03}, ('bool',))
    """

    grids: tuple[SparseGrid, ...]
    value_types: tuple[str, ...]
    metadata: Mapping[str, Any]
    skipped: tuple[str, ...]
    version: int
    library_version: tuple[int, int]
    entries: tuple[Mapping[str, Any], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the grids, in order."""
        return tuple(grid.name for grid in self.grids)

    def __iter__(self) -> Iterator[SparseGrid]:
        return iter(self.grids)

    def __len__(self) -> int:
        return len(self.grids)

    def __getitem__(self, key: int | str) -> SparseGrid:
        if isinstance(key, int):
            return self.grids[key]
        for grid in self.grids:
            if grid.name == key:
                return grid
        raise KeyError(f"no grid is named {key!r}; the file has {list(self.names)}")

    def __repr__(self) -> str:
        skipped = f", {len(self.skipped)} skipped" if self.skipped else ""
        return f"VdbFile({', '.join(map(repr, self.names))}{skipped})"


# -- reading ---------------------------------------------------------------------------------------


def read_vdb(path: str | os.PathLike[str]) -> VdbFile:
    """Read the grids of a .vdb file.

    Parameters
    ----------
    path : path
        A file of version 222 to 225 (OpenVDB 3 to 13): bool, mask and float grids, float also in half
        precision; uncompressed, zip- or Blosc-compressed (the latter needs the extra `vdb`).

    Returns
    -------
    VdbFile
        A bool grid whose values are true where active and false elsewhere becomes a mask, any other bool
        grid a float grid of ones and zeros. Inactive values that differ from the background, such as the
        inside of a level set, are kept.

    Raises
    ------
    GridReadError
        If the file is missing, is not a .vdb file, is damaged, or has voxels beyond +-2**23.

    Warns
    -----
    UserWarning
        Names the grids of other types (double, integer, vector, points) and with frustum transforms, which
        are skipped.

    Notes
    -----
    Every count and offset is checked against what is left of the file before anything is allocated; time and
    memory are bounded by a multiple of the file's size.

    References
    ----------
    .. [1] K. Museth, VDB: High-resolution sparse volumes with dynamic topology, ACM Trans. Graph. 32(3),
       2013, doi:10.1145/2487228.2487235.

    Examples
    --------
    >>> import os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "a.vdb")
    >>> write_vdb(path, [SparseGrid.from_ijk([[-1, 0, 0]], voxel_size=0.5, name="inside")])
    >>> read_vdb(path)[0].index_to_world([[-1, 0, 0]])
    array([[-0.25,  0.25,  0.25]])
    """
    file = input_file(path, GridReadError)
    try:
        data = file.read_bytes()
    except OSError as error:
        raise GridReadError(f"`path` must be a readable file; got {os.fspath(path)!r}: {error}") from error
    try:
        file = _read(Source(data))
    except GridReadError as error:
        raise GridReadError(f"{os.fspath(path)}: {error}") from error
    if file.skipped:
        warnings.warn(f"{os.fspath(path)}: skipped {'; '.join(file.skipped)}", UserWarning, stacklevel=2)
    return file


def _read(source: Source) -> VdbFile:
    """Header and grids."""
    if source.left < 8 or source.number("q", "the file's magic number") != MAGIC:
        raise GridReadError("`path` must be a .vdb file; got another magic number")
    version = source.number("I", "the file version")
    if version not in VERSIONS:
        raise GridReadError(f"the file version must be in {VERSIONS[0]}..{VERSIONS[-1]}; got {version}")
    major, minor = source.unpack("II", "the library version")
    has_offsets = source.number("B", "the offset flag") != 0
    source.take(36, "the file's UUID")
    metadata = read_metadata(source)
    n_grids = source.number("i", "the number of grids")
    source.need(n_grids * 40, f"{n_grids} grids")
    grids: list[tuple[SparseGrid, str, dict[str, Any]]] = []
    skipped: list[str] = []
    trees: dict[str, tuple[SparseGrid, str]] = {}
    for _ in range(n_grids):
        try:
            grids.append(_read_grid(source, has_offsets, trees))
        except UnsupportedGridError as reason:
            skipped.append(str(reason))
            if not has_offsets:
                skipped.append("all grids after it (the file has no offsets)")
                break
    return VdbFile(
        tuple(grid for grid, _, _ in grids),
        tuple(kind for _, kind, _ in grids),
        metadata,
        tuple(skipped),
        version,
        (int(major), int(minor)),
        tuple(entries for _, _, entries in grids),
    )


def _read_grid(
    source: Source, has_offsets: bool, trees: dict[str, tuple[SparseGrid, str]]
) -> tuple[SparseGrid, str, dict[str, Any]]:
    """One grid, its type and its metadata; leaves the source at the grid's end, also when the grid is not supported."""
    unique_name, tree_name = source.text("the name of a grid"), source.text("the type of a grid")
    parent = source.text("the parent of a grid")
    grid_at, block_at, end_at = source.unpack("qqq", "the offsets of a grid")
    body = source
    if has_offsets:
        if not source.at <= grid_at <= end_at <= len(source.data):
            raise GridReadError(
                f"the offsets of grid {unique_name!r} must lie in {source.at}..{len(source.data)}; "
                f"got {grid_at}..{end_at}"
            )
        body = Source(b"")
        body.data, body.at = source.data[:end_at], grid_at
        source.at = end_at
    name = unique_name.split(_SEPARATOR)[0]
    kind = _TREES.get(tree_name) or _TREES.get(tree_name.removesuffix("_HalfFloat"))
    if kind is None:
        raise UnsupportedGridError(f"{name!r} ({tree_name})")
    flags = body.number("I", "compression flags")
    if flags & ~(ZIP | MASKED | BLOSC):
        raise UnsupportedGridError(f"{name!r} (compression {flags})")
    entries = read_metadata(body)
    try:
        matrix = read_map(body)
    except UnsupportedGridError as reason:
        raise UnsupportedGridError(f"{name!r} ({reason})") from None
    if parent:
        if parent not in trees:
            raise GridReadError(f"grid {name!r} must share the tree of a grid before it; got {parent!r}")
        # Thousands of grids may share one tree: its arrays are shared as well.
        first, kind = trees[parent]
        with _damage(name):
            return first._reframed(**_frame_of(matrix, name, entries)), kind, entries
    tree = read_tree(body, kind, flags, block_at if has_offsets else 0)
    with _damage(name):
        grid = _grid_from(tree, _frame_of(matrix, name, entries))
    trees[unique_name] = grid, kind
    return grid, kind, entries


@contextmanager
def _damage(name: str) -> Generator[None]:
    """What is wrong with the cells or the transform of a grid is the file's fault."""
    try:
        yield
    except ValueError as error:
        raise GridReadError(f"grid {name!r} is damaged: {error}") from error


def _frame_of(matrix: NDArray[np.float64], name: str, entries: dict[str, Any]) -> dict[str, Any]:
    """Where a grid is and what it is called."""
    linear = np.ascontiguousarray(matrix[:3, :3])
    origin = matrix[:3, 3] - linear @ np.full(3, 0.5)
    exact = np.asarray(entries.get(_ORIGIN, origin))
    if exact.shape == (3,) and (exact + linear @ np.full(3, 0.5) == matrix[:3, 3]).all():
        origin = exact
    label = entries.get("class", "unknown")
    given_name = entries.get("name", name)
    return {
        "origin": origin,
        "linear": linear,
        "name": given_name if isinstance(given_name, str) else name,
        "grid_class": label if label in GRID_CLASSES else "unknown",
        "metadata": {key: value for key, value in entries.items() if key not in _DERIVED},
    }


def _grid_from(tree: Tree, frame: dict[str, Any]) -> SparseGrid:
    """A grid from a tree that was read."""
    active = tree.tile_is_on
    inactive = ~active
    values: dict[str, Any] = {}
    if not tree.is_mask:
        values = {
            "tile_values": tree.tile_values[active].astype(np.float32),
            "leaf_values": leaf_numbers(tree.leaf_values, tree.leaf_mask),
            "background": float(tree.background),
            "inactive_ijk": tree.tile_ijk[inactive],
            "inactive_log2": tree.tile_log2[inactive],
            "inactive_values": tree.tile_values[inactive].astype(np.float32),
        }
    return SparseGrid(
        cast(Any, tree.tile_ijk[active]),
        tree.tile_log2[active],
        cast(Any, tree.leaf_ijk),
        tree.leaf_mask,
        **values,
        **frame,
    )


# -- writing ---------------------------------------------------------------------------------------


def write_vdb(
    path: str | os.PathLike[str],
    grids: SparseGrid | Iterable[SparseGrid] | Mapping[str, SparseGrid] | NamedGrids,
    *,
    metadata: Mapping[str, Any] | None = None,
    value_type: ValueType | None = None,
    compression: Compression = "none",
) -> None:
    """Write grids to a .vdb file of version 224, which OpenVDB 3 and later read.

    Parameters
    ----------
    path : path
        Written under a temporary name in the same folder, then renamed: never half a file.
    grids : SparseGrid, iterable of SparseGrid, mapping of name to SparseGrid, or KernelGrid
        In order; the keys of a mapping replace the names of the grids. A `KernelGrid` is written as "inside" and
        "boundary" with the metadata that `KernelGrid.read` needs.
    metadata : mapping of str to bool, int, float, str or tuple, optional
        Metadata of the file. Tuples have 2 to 4 numbers (vec3i, vec3d, ...) or 16 (mat4d). Each grid's own
        `metadata` is written with the grid.
    value_type : {"bool", "mask", "float", "half"}, optional
        Type of every grid; default "bool" for masks (the one that all readers know) and "float" for float
        grids. A mask as "float" has value 1 where active; a float grid as "bool" or "mask" is refused, see
        `SparseGrid.to_mask`.
    compression : {"none", "zip", "blosc"}, default "none"
        Of values; masks are never compressed, so that it matters for float grids only. "blosc" needs the
        extra `vdb`.

    Raises
    ------
    TypeError
        If `grids` holds anything else, or a metadata value has no type in .vdb files.
    ValueError
        If an option is unknown, or a tile of more than 2**24 pieces of 4096^3 voxels would have to be split.
    OSError
        If the file cannot be written; an existing file is then unchanged.

    Notes
    -----
    Tiles of edge 8, 128 and 4096 are written as they are, others as the next smaller of these. The same
    input gives the same bytes.

    References
    ----------
    .. [1] K. Museth, VDB: High-resolution sparse volumes with dynamic topology, ACM Trans. Graph. 32(3),
       2013, doi:10.1145/2487228.2487235.

    Examples
    --------
    >>> import os, tempfile
    >>> path = os.path.join(tempfile.mkdtemp(), "kernel.vdb")
    >>> ball = SparseGrid.from_ijk([[0, 0, 0], [0, 0, 1]])
    >>> write_vdb(path, {"inside": ball, "boundary": ball}, metadata={"alpha": 0.03, "source": "face.ply"})
    >>> read_vdb(path).names
    ('inside', 'boundary')
    """
    as_choice("compression", compression, tuple(_FLAGS))
    if value_type is not None:
        as_choice("value_type", value_type, tuple(_TREE_NAMES))
    if isinstance(grids, NamedGrids):
        metadata, grids = {**grids.file_metadata(), **(metadata or {})}, grids.to_grids()
    named = _named(grids)
    header = [struct.pack("<qIII?", MAGIC, VERSION, 10, 0, True), b"", pack_metadata(metadata or {})]
    header.append(struct.pack("<i", len(named)))
    parts: list[bytes] = []
    at = sum(len(part) for part in header) + 36
    taken: set[str] = set()
    for name, grid in named:
        unique, number = name, 0
        while not unique or unique in taken:
            unique, number = f"{name}{_SEPARATOR}{number}", number + 1
        taken.add(unique)
        chunks = _packed(replace(grid, name=name), unique, value_type, compression, at)
        parts += chunks
        at += sum(len(chunk) for chunk in chunks)
    digest = sha256()
    for part in header + parts:
        digest.update(part)
    header[1] = str(uuid.UUID(bytes=digest.digest()[:16], version=4)).encode()
    with whole_file(path) as file:
        file.writelines(header + parts)


def _named(grids: object) -> list[tuple[str, SparseGrid]]:
    """Names and grids, whichever way they were given."""
    if isinstance(grids, SparseGrid):
        return [(grids.name, grids)]
    if isinstance(grids, Mapping):
        named = list(cast("Mapping[str, SparseGrid]", grids).items())
    elif isinstance(grids, Iterable):
        listed = list(cast("Iterable[SparseGrid]", grids))
        named = [(getattr(grid, "name", ""), grid) for grid in listed]
    else:
        raise TypeError(f"`grids` must be SparseGrid, or several of them; got {type(grids).__name__}")
    for _, grid in named:
        if not isinstance(cast(object, grid), SparseGrid):
            raise TypeError(f"`grids` must hold SparseGrid only; got {type(grid).__name__}")
    return named


def _packed(
    grid: SparseGrid, unique: str, value_type: ValueType | None, compression: Compression, at: int
) -> list[bytes]:
    """One grid as bytes that will stand at `at`."""
    kind: ValueType = value_type or ("bool" if grid.is_mask else "float")
    if not grid.is_mask and kind in ("bool", "mask"):
        raise ValueError(f"`value_type` must be 'float' or 'half' for a grid with values; got {kind!r} (see to_mask)")
    topology, buffers = write_tree(grid, kind, _FLAGS[compression])
    bbox = grid.active_bbox
    entries: dict[str, Any] = dict(grid.metadata) | {
        "class": grid.grid_class,
        "name": grid.name,
        "file_compression": _FLAG_NAMES[compression],
        "file_voxel_count": min(grid.active_voxel_count, 2**63 - 1),
        _ORIGIN: tuple(grid.origin.tolist()),
    }
    if bbox is not None:
        entries |= {"file_bbox_min": tuple(bbox[0].tolist()), "file_bbox_max": tuple(bbox[1].tolist())}
    if kind == "half":
        entries["is_saved_as_half_float"] = True
    ahead = [struct.pack("<I", _FLAGS[compression]), pack_metadata(entries), pack_map(grid.transform)]
    title = [pack_text(unique), pack_text(_TREE_NAMES[kind]), pack_text("")]
    grid_at = at + sum(len(part) for part in title) + 24
    block_at = grid_at + sum(len(part) for part in ahead + topology)
    end_at = block_at + sum(len(part) for part in buffers)
    return [*title, struct.pack("<qqq", grid_at, block_at, end_at), *ahead, *topology, *buffers]
