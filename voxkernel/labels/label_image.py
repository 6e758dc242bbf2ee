"""`LabelImage`: a label image in memory or in a file, read in boxes."""

from __future__ import annotations

import mmap
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import prod
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_each, as_integers, as_positive
from voxkernel._frozen import Frozen
from voxkernel.errors import GridReadError
from voxkernel.labels.voxel_values import as_label_values, check_label_type

__all__ = [
    "MOST_HELD", "LabelImage", "as_spacing", "block_boxes", "give_back", "layers_of", "pages_of", "slow_axis",
]  # fmt: skip

_BLOCK_BYTES = 1 << 25  # of a block that is scanned at once
_LEAST_SPACING = 1e-60  # volumes and squares of it are numbers
_CACHE_BYTES = 1 << 25  # of chunks that are kept unpacked
MOST_HELD = 1 << 25  # bytes of a mapped file
_PAGES = 1 << 16  # bytes that a system maps at once, when one of them is asked for


class _Chunks:
    """Chunks of a compressed file, the last ones used kept."""

    def __init__(
        self, read: Callable[[tuple[slice, ...]], Any], shape: Sequence[int], edges: Sequence[int], dtype: Any
    ) -> None:
        self.read, self.shape, self.edges, self.dtype = read, tuple(shape), tuple(edges), np.dtype(dtype)
        self.kept: OrderedDict[tuple[int, ...], NDArray[Any]] = OrderedDict()
        self.size = 0
        self.lock = Lock()

    def __getitem__(self, box: tuple[slice, ...]) -> NDArray[Any]:
        ranges = [range(s.start // e, -(-s.stop // e)) for s, e in zip(box, self.edges, strict=True)]
        parts = [(place, self.chunk(place)) for place in product(*ranges)]
        shape = tuple(s.stop - s.start for s in box)
        out = np.empty(shape, parts[0][1].dtype) if parts else np.empty(shape, np.uint8)
        for place, chunk in parts:
            into, of = [], []
            for s, edge, p, n in zip(box, self.edges, place, chunk.shape, strict=True):
                low, high = max(s.start, p * edge), min(s.stop, p * edge + n)
                into.append(slice(low - s.start, high - s.start))
                of.append(slice(low - p * edge, high - p * edge))
            out[tuple(into)] = chunk[tuple(of)]
        return out

    def chunk(self, place: tuple[int, ...]) -> NDArray[Any]:
        with self.lock:  # also because not every reader may be called from two threads
            if place in self.kept:
                self.kept.move_to_end(place)
                return self.kept[place]
            box = tuple(
                slice(p * e, min((p + 1) * e, n)) for p, e, n in zip(place, self.edges, self.shape, strict=True)
            )
            try:
                chunk = np.asarray(self.read(box))
            except Exception as error:  # every library has its own for a damaged file
                words = " ".join(str(error).split())[:200]
                where = tuple(s.start for s in box)
                raise GridReadError(f"`labels` cannot be read at {where}: {type(error).__name__}: {words}") from error
            self.kept[place] = chunk
            self.size += chunk.nbytes
            while self.size > _CACHE_BYTES and len(self.kept) > 1:
                self.size -= self.kept.popitem(last=False)[1].nbytes
            return chunk


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LabelImage(Frozen):
    """A label image of two or three axes, in memory or in a file that is read in boxes.

    Made by `read_labels`, or from an array by `from_array`.

    Attributes
    ----------
    source : array-like
        What holds the voxels: a NumPy array, or anything with `shape`, `dtype` and slices, which give arrays.
    shape : tuple of int
        Voxels along each axis.
    spacing : tuple of float
        Distance of voxel centres along each axis, in the order of the axes; world units.
    chunks : tuple of int
        Edges of the boxes in which the source is best read.
    affine : (4, 4) float64 or None
        From indices along the axes to the world of NIfTI (x to the right, y to the front, z up), as `.nii`, `.nii.gz`
        and `.nrrd` store it; None for other files and arrays. It stays that of the file where another spacing is given.
    unit : str or None
        Of a spacing that the file stores, as "um" or "mm"; None where the file names none.
    """

    source: Any = field(repr=False)
    shape: tuple[int, ...]
    spacing: tuple[float, ...]
    chunks: tuple[int, ...]
    affine: NDArray[np.float64] | None = field(default=None, repr=False)
    unit: str | None = field(default=None, repr=False)
    _nifti: tuple[tuple[str, Any], ...] = field(default=(), repr=False)  # fields of the header that say where it lies

    @classmethod
    def from_array(cls, labels: Any, *, spacing: Sequence[float]) -> LabelImage:
        """Take an array, or what gives arrays when it is sliced (h5py, zarr, a memory map), without reading it.

        Parameters
        ----------
        labels : array of int, 2 or 3 axes
            0 is background; floats with integer values are taken.
        spacing : sequence of float
            One number for each axis, > 0.

        Returns
        -------
        LabelImage
            Shares the array.

        Raises
        ------
        TypeError, ValueError
            If the array has other axes or another type, or `spacing` does not fit it.
        """
        is_lazy = all(hasattr(labels, name) for name in ("shape", "dtype", "__getitem__"))
        source = labels if is_lazy else _plain_array(labels)
        if isinstance(source, np.ma.MaskedArray):
            raise TypeError("`labels` must not be masked (fill it with 0 where it is background); got a masked array")
        shape = tuple(int(n) for n in source.shape)
        check_label_type(np.dtype(source.dtype))
        if len(shape) not in (2, 3):
            raise ValueError(f"`labels` must have 2 or 3 axes; got {len(shape)}, of shape {shape}")
        if 0 in shape:
            raise ValueError(f"`labels` must have voxels; got shape {shape}")
        if max(shape) > 2**20 - 2:
            raise ValueError(f"`labels` must have fewer than 2**20 - 1 voxels along each axis; got shape {shape}")
        chunks = None if isinstance(source, np.ndarray) else getattr(source, "chunks", None)
        if chunks is not None and all(isinstance(n, int) for n in chunks):
            chunks = tuple(min(n, m) for n, m in zip(chunks, shape, strict=True))
            source = _Chunks(source.__getitem__, shape, chunks, source.dtype)
        else:
            chunks = (1,) * len(shape)
        return cls(source=source, shape=shape, spacing=as_spacing(spacing, len(shape)), chunks=chunks)

    @property
    def is_flat(self) -> bool:
        """Whether the image has two axes."""
        return len(self.shape) == 2

    def read(self, low: Sequence[int], high: Sequence[int]) -> NDArray[Any]:
        """Read the labels of a box.

        Parameters
        ----------
        low, high : sequence of int
            First voxel along each axis, and one behind the last; inside the image.

        Returns
        -------
        array of uint8, uint16, uint32 or int64
            C-contiguous; may share memory with the image.

        Raises
        ------
        ValueError
            If the box is not in the image, or a label is negative, not an integer, or above 2**63 - 1.
        """
        first = as_integers("low", low, shape="(axes,)", ndim=1).tolist()
        last = as_integers("high", high, shape="(axes,)", ndim=1).tolist()
        if not len(first) == len(last) == len(self.shape) or not all(
            0 <= a < b <= n for a, b, n in zip(first, last, self.shape, strict=True)
        ):
            raise ValueError(f"`low` and `high` must be a box in an image of shape {self.shape}; got {first}, {last}")
        return self._box(first, last)

    def to_array(self) -> NDArray[Any]:
        """Read all labels.

        Returns
        -------
        array of uint8, uint16, uint32 or int64
            In the shape of the image.

        Raises
        ------
        ValueError
            If a label is negative, not an integer, or above 2**63 - 1.
        """
        return self._box([0] * len(self.shape), self.shape)

    def _box(self, low: Sequence[int], high: Sequence[int]) -> NDArray[Any]:
        return as_label_values(np.asarray(self.source[tuple(map(slice, low, high))]))


def as_spacing(spacing: object, n_axes: int) -> tuple[float, ...]:
    """One positive number for each axis."""
    numbers = as_each("spacing", spacing, as_positive)
    if len(numbers) != n_axes:
        raise ValueError(f"`spacing` must have one number for each of {n_axes} axes; got {len(numbers)}")
    if not all(_LEAST_SPACING <= n <= 1 / _LEAST_SPACING for n in numbers):
        raise ValueError(f"`spacing` must be from {_LEAST_SPACING:g} to {1 / _LEAST_SPACING:g}; got {numbers}")
    if max(numbers) > 1e6 * min(numbers):
        raise ValueError(f"`spacing` must not differ by more than a factor of 1e6 between axes; got {numbers}")
    return numbers


def block_boxes(image: LabelImage) -> list[tuple[list[int], list[int]]]:
    """Cut an image into boxes of some 32 MB that do not cut chunks."""
    edges = list(image.chunks)
    size = np.dtype(image.source.dtype).itemsize
    strides = getattr(image.source, "strides", None) or range(len(edges), 0, -1)
    for axis in sorted(range(len(edges)), key=lambda axis: abs(strides[axis])):
        fits = max(1, _BLOCK_BYTES // size // int(np.prod(edges)))
        edges[axis] = min(image.shape[axis], edges[axis] * fits)
    ranges = [range(0, n, e) for n, e in zip(image.shape, edges, strict=True)]
    return [
        (list(low), [min(a + e, n) for a, e, n in zip(low, edges, image.shape, strict=True)])
        for low in product(*ranges)
    ]


def slow_axis(image: LabelImage) -> int:
    """The axis along which neighbours are farthest apart in memory or in the file, as a rule the first."""
    strides = getattr(image.source, "strides", None)
    return 0 if strides is None else max(range(len(strides)), key=lambda axis: abs(strides[axis]))


def layers_of(image: LabelImage, low: Sequence[int], high: Sequence[int]) -> list[tuple[int, int]]:
    """Cut a box into layers along the slow axis, of some 32 MB each, that do not cut chunks."""
    edges, axis = [b - a for a, b in zip(low, high, strict=True)], slow_axis(image)
    first, end = low[axis], high[axis]
    if 8 * prod(edges) <= _BLOCK_BYTES:
        return [(first, end)]
    of_one, edge = np.dtype(image.source.dtype).itemsize * (prod(edges) // edges[axis]), image.chunks[axis]
    n = edge * max(1, _BLOCK_BYTES // (of_one * edge))
    starts = [first, *range((first // edge) * edge + n, end, n)]
    return list(zip(starts, [*starts[1:], end], strict=True))


def pages_of(image: LabelImage, low: Sequence[int], high: Sequence[int]) -> int:
    """About how many bytes of a mapped file a process holds after it has read a box; 0 where none is mapped."""
    if not isinstance(image.source, np.memmap):
        return 0
    edges, strides = [b - a for a, b in zip(low, high, strict=True)], [abs(n) for n in image.source.strides]
    fast = min(range(len(edges)), key=lambda axis: strides[axis])
    n_rows = prod(edges) // edges[fast]
    return min(n_rows * (_PAGES + edges[fast] * strides[fast]), max(e * s for e, s in zip(edges, strides, strict=True)))


def give_back(image: LabelImage) -> None:
    """Let go of what the process holds of a large file that is mapped for reading; it is mapped again when needed."""
    source = image.source
    if not isinstance(source, np.memmap) or source.mode != "r" or source.nbytes <= _BLOCK_BYTES:
        return
    mapped = source._mmap  # pyright: ignore[reportAttributeAccessIssue, reportUnknownMemberType, reportUnknownVariableType]
    if isinstance(mapped, mmap.mmap) and hasattr(mapped, "madvise") and hasattr(mmap, "MADV_DONTNEED"):
        mapped.madvise(mmap.MADV_DONTNEED)


def _plain_array(labels: object) -> NDArray[Any]:
    try:
        return np.asarray(labels)
    except ValueError:
        raise ValueError("`labels` must be an array; got rows of different lengths") from None
