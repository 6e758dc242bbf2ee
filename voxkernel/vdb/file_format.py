"""The bytes of a .vdb file below the tree: constants, checked reading, metadata and transforms.

OpenVDB (https://www.openvdb.org) publishes no specification; the layout follows its io/ and tree/ sources
for file versions 222 to 225.
"""

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel.errors import GridReadError, VoxKernelError

__all__ = [
    "BLOSC",
    "MAGIC",
    "MASKED",
    "VERSION",
    "VERSIONS",
    "ZIP",
    "Source",
    "UnsupportedGridError",
    "pack_map",
    "pack_metadata",
    "pack_text",
    "read_map",
    "read_metadata",
]

MAGIC = 0x56444220
VERSION = 224
VERSIONS = range(222, 226)  # 225 (OpenVDB 13) added half grids and changed nothing else
ZIP, MASKED, BLOSC = 1, 2, 4  # compression flags of a grid

_SCALARS = {"bool": "?", "int32": "i", "int64": "q", "float": "f", "double": "d"}
_VECTORS = {f"vec{n}{code}": f"{n}{kind}" for n in (2, 3, 4) for code, kind in (("i", "i"), ("s", "f"), ("d", "d"))}
_FORMATS = _SCALARS | _VECTORS | {"mat4s": "16f", "mat4d": "16d"}


class UnsupportedGridError(VoxKernelError):
    """A grid of a kind this library does not hold; the rest of its file can still be read."""


class Source:
    """A file in memory and a place in it. Nothing is taken, or allocated, beyond the end."""

    def __init__(self, data: bytes) -> None:
        self.data = memoryview(data)
        self.at = 0

    @property
    def left(self) -> int:
        """Bytes not yet read."""
        return len(self.data) - self.at

    def need(self, n_bytes: int, what: str) -> None:
        """Raise unless that many bytes are left."""
        if not 0 <= n_bytes <= self.left:
            raise GridReadError(
                f"`path` must hold a complete .vdb file; got {self.left} bytes where {what} needs {n_bytes}, "
                f"at byte {self.at}"
            )

    def take(self, n_bytes: int, what: str) -> memoryview:
        """The next bytes, not copied."""
        self.need(n_bytes, what)
        self.at += n_bytes
        return self.data[self.at - n_bytes : self.at]

    def unpack(self, fmt: str, what: str) -> tuple[Any, ...]:
        """The next little-endian numbers."""
        return struct.unpack("<" + fmt, self.take(struct.calcsize("<" + fmt), what))

    def number(self, code: str, what: str) -> int:
        """One integer."""
        return int(self.unpack(code, what)[0])

    def array(self, dtype: Any, count: int, what: str) -> NDArray[Any]:
        """The next `count` items as a read-only view."""
        kind = np.dtype(dtype)
        return np.frombuffer(self.take(count * kind.itemsize, what), dtype=kind, count=count)

    def text(self, what: str) -> str:
        """A string with its length ahead."""
        return bytes(self.take(self.number("I", what), what)).decode("utf-8", errors="replace")


def read_metadata(source: Source) -> dict[str, Any]:
    """Typed metadata; entries of types this library does not know are left out."""
    entries: dict[str, Any] = {}
    count = source.number("I", "the number of metadata entries")
    source.need(12 * count, f"{count} metadata entries")
    for _ in range(count):
        key, kind = source.text("a metadata name"), source.text("a metadata type")
        raw = source.take(source.number("I", "the size of a metadata value"), "a metadata value")
        if kind == "string":
            entries[key] = bytes(raw).decode("utf-8", errors="replace")
        elif kind in _FORMATS:
            fmt = "<" + _FORMATS[kind]
            if struct.calcsize(fmt) != len(raw):
                raise GridReadError(f"metadata {key!r} must be {struct.calcsize(fmt)} bytes of {kind}; got {len(raw)}")
            numbers = struct.unpack(fmt, raw)
            entries[key] = numbers[0] if kind in _SCALARS else numbers
    return entries


def pack_text(text: str) -> bytes:
    """A string with its length ahead."""
    raw = text.encode()
    return struct.pack("<I", len(raw)) + raw


def pack_metadata(entries: Mapping[str, Any]) -> bytes:
    """Typed metadata, in the order given."""
    parts = [struct.pack("<I", len(entries))]
    for key, value in entries.items():
        kind, raw = _pack_entry(key, value)
        parts += [pack_text(key), pack_text(kind), struct.pack("<I", len(raw)), raw]
    return b"".join(parts)


def _pack_entry(key: object, value: object) -> tuple[str, bytes]:
    """Type name and bytes of one value."""
    if not isinstance(key, str):
        raise TypeError(f"`metadata` must have str keys; got {type(key).__name__}")
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, str):
        return "string", value.encode()
    if isinstance(value, bool):
        return "bool", struct.pack("<?", value)
    if isinstance(value, int):
        if not -(2**63) <= value < 2**63:
            raise ValueError(f"`metadata` must hold integers of 64 bits; got {key!r}: {value}")
        return "int64", struct.pack("<q", value)
    if isinstance(value, float):
        return "double", struct.pack("<d", value)
    if isinstance(value, list | tuple):
        numbers = np.asarray(value)
        is_int = numbers.dtype.kind in "iu" and (np.abs(numbers.astype(np.float64)) < 2**31).all()
        if is_int and numbers.shape in ((2,), (3,), (4,)):
            return f"vec{len(numbers)}i", numbers.astype("<i4").tobytes()
        if numbers.dtype.kind in "fiu" and numbers.shape in ((2,), (3,), (4,), (16,), (4, 4)):
            kind = f"vec{len(numbers)}d" if numbers.size < 16 else "mat4d"
            return kind, numbers.astype("<f8").tobytes()
    raise TypeError(
        f"`metadata` must hold bool, int, float, str, or 2 to 4 or 16 numbers; got {key!r}: {type(value).__name__}"
    )


def read_map(source: Source) -> NDArray[np.float64]:
    """(4, 4) matrix from index (integers are voxel centres) to world, for column vectors."""
    kind = source.text("the name of a transform")
    matrix = np.eye(4)
    if kind in ("AffineMap", "UnitaryMap"):
        stored = source.array("<f8", 16, kind).reshape(4, 4).T
        if stored[3].tolist() != [0, 0, 0, 1]:
            raise GridReadError(f"an {kind} must not be projective; got last row {stored[3].tolist()}")
        matrix[:] = stored
    elif kind in ("ScaleMap", "UniformScaleMap"):
        matrix[:3, :3] = np.diag(source.array("<f8", 15, kind)[:3])
    elif kind in ("ScaleTranslateMap", "UniformScaleTranslateMap"):
        numbers = source.array("<f8", 18, kind)
        matrix[:3, 3] = numbers[:3]
        matrix[:3, :3] = np.diag(numbers[3:6])
    elif kind == "TranslationMap":
        matrix[:3, 3] = source.array("<f8", 3, kind)
    else:
        raise UnsupportedGridError(f"transform {kind!r}")
    return matrix


def pack_map(matrix: NDArray[np.float64]) -> bytes:
    """The simplest of OpenVDB's maps that is this matrix."""
    scale = np.diag(matrix)[:3]
    if (matrix[:3, :3] != np.diag(scale)).any():
        return pack_text("AffineMap") + np.ascontiguousarray(matrix.T, dtype="<f8").tobytes()
    kind = "UniformScaleTranslateMap" if (scale == scale[0]).all() else "ScaleTranslateMap"
    with np.errstate(over="ignore"):
        numbers = np.concatenate([matrix[:3, 3], scale, np.abs(scale), 1 / scale, 1 / scale**2, 0.5 / scale])
    return pack_text(kind) + numbers.astype("<f8").tobytes()
