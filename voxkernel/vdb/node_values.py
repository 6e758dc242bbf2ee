"""Values of a tree's nodes as .vdb files store them: masked, compressed, in half precision."""

import struct
import zlib
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.errors import GridReadError
from voxkernel.vdb.file_format import BLOSC, MASKED, ZIP, Source

__all__ = [
    "Codec",
    "pack_bits",
    "read_leaf_values",
    "read_values",
    "unpack_bits",
    "write_leaf_values",
    "write_values",
]

# What a node says about its inactive values; OpenVDB's io/Compression.h.
_ALL_BACKGROUND, _ALL_MINUS, _ONE, _MASK_MINUS, _MASK_ONE, _MASK_TWO, _EVERY_VALUE = range(7)
_N_STORED = (0, 0, 1, 0, 1, 2, 0)  # inactive values written out, by mode
_HAS_SELECTION = (False, False, False, True, True, True, False)

_BLOSC_HEADER = 16


class Codec(NamedTuple):
    """How the values of one grid are stored."""

    dtype: np.dtype[Any]
    stored: np.dtype[Any]
    background: Any
    flags: int

    @classmethod
    def of(cls, kind: str, background: Any, flags: int) -> "Codec":
        """Codec of a "bool", "mask", "float" or "half" grid."""
        if kind in ("bool", "mask"):
            return cls(np.dtype("?"), np.dtype("?"), np.bool_(background), flags)
        stored = np.dtype("<f2" if kind == "half" else "<f4")
        return cls(np.dtype("<f4"), stored, np.float32(background), flags)

    @property
    def chunk_flags(self) -> int:
        """How chunks of values are compressed."""
        return self.flags & (ZIP | BLOSC)

    def read_stored(self, source: Source, count: int) -> memoryview | bytes:
        """The bytes of `count` values. Of no half-precision values OpenVDB writes not even a size."""
        if not count and self.stored.itemsize == 2:
            return b""
        return _read_chunk(source, count * self.stored.itemsize, self.chunk_flags)

    def write_stored(self, raw: bytes) -> bytes:
        """A chunk of values that are already in stored form."""
        if not raw and self.stored.itemsize == 2:
            return b""
        return _write_chunk(raw, self.chunk_flags)

    @property
    def minus(self) -> Any:
        """What OpenVDB calls the negative of the background; of a bool that is the other one."""
        return ~self.background if self.dtype.kind == "b" else -self.background


def unpack_bits(raw: memoryview) -> NDArray[np.bool_]:
    """Bits, lowest first."""
    return np.unpackbits(np.frombuffer(raw, np.uint8), bitorder="little").view(np.bool_)


def pack_bits(count: int, places: NDArray[np.integer[Any]]) -> bytes:
    """`count` bits, those at `places` set."""
    bits = np.zeros(count, dtype=np.bool_)
    bits[places] = True
    return np.packbits(bits, bitorder="little").tobytes()


def _read_chunk(source: Source, n_bytes: int, flags: int) -> memoryview | bytes:
    """The next values' bytes, decompressed to exactly `n_bytes`."""
    if not flags & (ZIP | BLOSC):
        return source.take(n_bytes, "values")
    size = source.number("q", "the size of compressed values")
    if size <= 0:  # stored as they are
        if -size != n_bytes:
            raise GridReadError(f"a chunk of values must have {n_bytes} bytes; got {-size}")
        return source.take(n_bytes, "values")
    packed = source.take(size, "compressed values")
    if flags & BLOSC:
        return _unblosc(packed, n_bytes)
    unzip = zlib.decompressobj()
    try:
        plain = unzip.decompress(packed, n_bytes + 1)
    except zlib.error as error:
        raise GridReadError(f"zip-compressed values cannot be read: {error}") from error
    if len(plain) != n_bytes or not unzip.eof:
        raise GridReadError(f"a chunk of values must unpack to {n_bytes} bytes; got {len(plain)} or more")
    return plain


def _unblosc(packed: memoryview, n_bytes: int) -> bytes:
    """Blosc's header states both sizes: they are checked before it allocates anything."""
    blosc = optional("blosc")
    if len(packed) < _BLOSC_HEADER:
        raise GridReadError(f"Blosc-compressed values must have at least 16 bytes; got {len(packed)}")
    plain_size, _, packed_size = struct.unpack_from("<III", packed, 4)
    if plain_size != n_bytes or packed_size != len(packed):
        raise GridReadError(
            f"Blosc-compressed values must be {len(packed)} bytes for {n_bytes}; got {packed_size} for {plain_size}"
        )
    try:
        plain = blosc.decompress(bytes(packed))
    except (blosc.blosc_extension.error, ValueError, RuntimeError) as error:
        raise GridReadError(f"Blosc-compressed values cannot be read: {error}") from error
    if len(plain) != n_bytes:
        raise GridReadError(f"a chunk of values must unpack to {n_bytes} bytes; got {len(plain)}")
    return plain


def _write_chunk(raw: bytes, flags: int) -> bytes:
    """Bytes of values, compressed when that makes them shorter."""
    if not flags & (ZIP | BLOSC):
        return raw
    if flags & ZIP:
        packed = zlib.compress(raw)
    else:
        packed = optional("blosc").compress(raw, typesize=4, cname="lz4") if len(raw) > 48 else raw
    if len(packed) < len(raw):
        return struct.pack("<q", len(packed)) + packed
    return struct.pack("<q", -len(raw)) + raw


def _read_inactive(source: Source, count: int, codec: Codec) -> tuple[int, Any, Any, NDArray[np.bool_] | None]:
    """Mode of a node and its inactive values: (mode, value where not selected, where selected, selection)."""
    mode = source.number("B", "the mode of a node")
    if mode > _EVERY_VALUE:
        raise GridReadError(f"the mode of a node must be 0..6; got {mode}, at byte {source.at - 1}")
    plain, selected = (codec.background if mode == _ALL_BACKGROUND else codec.minus), codec.background
    if _N_STORED[mode]:
        stored = source.array(codec.dtype, _N_STORED[mode], "inactive values")
        plain, selected = stored[0], (stored[1] if mode == _MASK_TWO else selected)
    selection = unpack_bits(source.take(count // 8, "a selection mask")) if _HAS_SELECTION[mode] else None
    return mode, plain, selected, selection


def read_values(source: Source, is_on: NDArray[np.bool_], codec: Codec) -> NDArray[Any]:
    """All values of a node, active and inactive; `is_on` is its mask of active values."""
    count = len(is_on)
    mode, plain, selected, selection = _read_inactive(source, count, codec)
    is_whole = mode == _EVERY_VALUE or not codec.flags & MASKED
    n_stored = count if is_whole else int(is_on.sum())
    raw = codec.read_stored(source, n_stored)
    stored = np.frombuffer(raw, np.uint8) != 0 if codec.dtype.kind == "b" else np.frombuffer(raw, codec.stored)
    if is_whole:
        return stored.astype(codec.dtype)
    values = np.full(count, plain, dtype=codec.dtype)
    if selection is not None:
        values[selection] = selected
    values[is_on] = stored
    return values


def read_leaf_values(source: Source, n_leaves: int, codec: Codec) -> tuple[NDArray[np.uint64], NDArray[np.float32]]:
    """Masks and values of float leaves; sizes differ from leaf to leaf, hence a Python loop."""
    source.need(n_leaves * 65, f"{n_leaves} leaves")
    masks = np.empty((n_leaves, 8), dtype=np.uint64)
    values = np.empty((n_leaves, 512), dtype=np.float32)
    chunks: list[memoryview | bytes] = []
    partial: list[int] = []
    is_brief = codec.flags & MASKED and not codec.chunk_flags
    row = scan_at = 0
    while row < n_leaves:
        if is_brief and row >= scan_at:
            begin, row = row, _read_brief_leaves(source, row, masks, values, codec)
            scan_at = row + (1 if row - begin > 16 else 64)  # a scan that finds few is not worth its arrays
            if row == n_leaves:
                break
        raw_mask = source.take(64, "a leaf's mask")
        masks[row] = np.frombuffer(raw_mask, "<u8")
        mode, plain, selected, selection = _read_inactive(source, 512, codec)
        if mode == _EVERY_VALUE or not codec.flags & MASKED:
            raw = codec.read_stored(source, 512)
            values[row] = np.frombuffer(raw, codec.stored)
        else:
            count = int.from_bytes(raw_mask, "little").bit_count()
            chunks.append(codec.read_stored(source, count))
            partial.append(row)
            values[row] = plain if selection is None else np.where(selection, selected, plain)
        row += 1
    if partial:
        _put_active(values, masks, np.array(partial), b"".join(chunks), codec)
    return masks, values


def _read_brief_leaves(
    source: Source, row: int, masks: NDArray[np.uint64], values: NDArray[np.float32], codec: Codec
) -> int:
    """Read the leaves from `row` on that have only background where inactive; give the row of the first other one.

    Most leaves are such, and this loop is short. A leaf that the file cuts off is left to the caller.
    """
    data, at, n_leaves, itemsize = source.data, source.at, len(masks), codec.stored.itemsize
    starts: list[int] = []
    counts: list[int] = []
    while len(starts) < n_leaves - row and at + 65 <= len(data) and data[at + 64] == _ALL_BACKGROUND:
        count = int.from_bytes(data[at : at + 64], "little").bit_count()
        end = at + 65 + count * itemsize
        if end > len(data):
            break
        starts.append(at)
        counts.append(count)
        at = end
    source.at = at
    if not starts:
        return row
    stop = row + len(starts)
    masks[row:stop] = np.frombuffer(b"".join([data[s : s + 64] for s in starts]), "<u8").reshape(-1, 8)
    is_full = np.array(counts) == 512
    full, others = np.flatnonzero(is_full), np.flatnonzero(~is_full)
    raw = b"".join([data[starts[k] + 65 : starts[k] + 65 + 512 * itemsize] for k in full.tolist()])
    values[full + row] = np.frombuffer(raw, codec.stored).reshape(-1, 512)
    raw = b"".join([data[starts[k] + 65 : starts[k] + 65 + counts[k] * itemsize] for k in others.tolist()])
    values[others + row] = codec.background
    _put_active(values, masks, others + row, raw, codec)
    return stop


def _put_active(
    values: NDArray[np.float32], masks: NDArray[np.uint64], rows: NDArray[np.intp], raw: bytes, codec: Codec
) -> None:
    """Put the stored values of some leaves where these are active."""
    is_on = np.unpackbits(masks[rows].astype("<u8").view(np.uint8), axis=1, bitorder="little").view(np.bool_)
    part = values[rows]
    part[is_on] = np.frombuffer(raw, codec.stored)
    values[rows] = part


def write_values(values: NDArray[Any], is_on: NDArray[np.bool_], is_off: NDArray[np.bool_], codec: Codec) -> bytes:
    """A node's values: active ones in full, inactive ones as briefly as OpenVDB's seven modes allow.

    `is_off` marks inactive values; slots that are neither (children) are stored as nothing.
    """
    # compared as bits: NaN and -0 are values too
    unsigned = np.uint8 if codec.dtype.kind == "b" else np.uint32
    off = values[is_off].view(unsigned)
    distinct = np.unique(off).tolist()
    background, minus = (int(value.view(unsigned)) for value in (codec.background, codec.minus))
    others = [bits for bits in distinct if bits != background]
    if not others:
        mode = _ALL_BACKGROUND
    elif len(distinct) == 1:
        mode = _ALL_MINUS if others == [minus] else _ONE
    elif len(others) == 1:
        mode = _MASK_MINUS if others == [minus] else _MASK_ONE
    else:
        mode = _MASK_TWO if len(distinct) == 2 else _EVERY_VALUE
    header = bytes([mode]) + np.array(others[: _N_STORED[mode]], dtype=unsigned).tobytes()
    if _HAS_SELECTION[mode]:
        selection = np.zeros(len(values), dtype=np.bool_)
        selection[is_off] = off == (others[1] if mode == _MASK_TWO else background)
        header += np.packbits(selection, bitorder="little").tobytes()
    kept = np.where(is_on | is_off, values, codec.dtype.type(0)) if mode == _EVERY_VALUE else values[is_on]
    return header + codec.write_stored(kept.astype(codec.stored).tobytes())


def write_leaf_values(masks: NDArray[np.uint64], values: NDArray[np.float32], codec: Codec) -> bytes:
    """Buffers of float leaves; most have only background where inactive, and no mode to find."""
    raw_masks = np.ascontiguousarray(masks, dtype="<u8").view(np.uint8).reshape(len(masks), 64)
    is_on = np.unpackbits(raw_masks, axis=1, bitorder="little").view(np.bool_)
    background = np.float32(codec.background).view(np.uint32)
    is_plain = (is_on | (values.view(np.uint32) == background)).all(axis=1)
    kept = memoryview(values[is_on].astype(codec.stored).tobytes())
    ends = np.cumsum(is_on.sum(axis=1)) * codec.stored.itemsize
    parts: list[bytes | memoryview] = []
    start = 0
    for row, end in enumerate(ends.tolist()):
        parts.append(raw_masks[row].tobytes())
        if is_plain[row]:
            parts.append(b"\0")
            chunk = kept[start:end]
            parts.append(codec.write_stored(bytes(chunk)) if codec.chunk_flags else chunk)
        else:
            parts.append(write_values(values[row], is_on[row], ~is_on[row], codec))
        start = end
    return b"".join(parts)
