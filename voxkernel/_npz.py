"""Arrays of an .npz file, checked before anything is unpacked: no pickles, no evaluated headers, no bombs.

Own code because NumPy evaluates headers (recursion and token errors), unpacks before it looks at a shape, and takes
whatever zip files can hold.
"""

from __future__ import annotations

import io
import json
import lzma
import math
import os
import re
import stat
import struct
import sys
import zipfile
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["DAMAGE", "NpzArrays", "is_shallow", "read_json"]

# What zipfile, zlib and json raise on files that are not what they seem.
DAMAGE = (
    OSError, ValueError, KeyError, EOFError, MemoryError, NotImplementedError, RuntimeError, OverflowError,
    struct.error, zipfile.BadZipFile, zlib.error, lzma.LZMAError,
)  # fmt: skip
_MOST_TEXT = 1 << 26  # bytes of a text, four a character
_MAX_DEFLATE = 1032  # deflate makes nothing shorter by more than this
_HEADER = re.compile(
    rb"\{'descr': '([<>|=]?[biufU][0-9]{1,9})', 'fortran_order': (True|False), "
    rb"'shape': \(((?:[0-9]{1,18}, ?)*[0-9]{0,18})\),? ?\} *\n"
)
_LONGEST_HEADER = 10_000


class NpzArrays:
    """The arrays of an .npz file by name; every failure is one of `DAMAGE`.

    Members are stored or deflated; none says that it is larger than its bytes can hold, and all of them together have
    no more bytes than the file. Each is read when it is asked for, after its header was held against its size.
    """

    def __init__(self, source: str | os.PathLike[str] | bytes) -> None:
        if isinstance(source, bytes):
            self._archive = zipfile.ZipFile(io.BytesIO(source))
            n_bytes = len(source)
            start = source[:2]
        else:
            status = os.stat(source)
            if not stat.S_ISREG(status.st_mode):
                raise ValueError("it is not an ordinary file")
            with open(source, "rb") as stream:
                start = stream.read(2)
            self._archive = zipfile.ZipFile(source)
            n_bytes = status.st_size
        if start != b"PK":  # zipfile takes archives behind anything else
            raise ValueError("it does not start as a zip file")
        self._members: dict[str, zipfile.ZipInfo] = {}
        for member in self._archive.infolist():
            name = member.filename.removesuffix(".npy")
            if name in self._members:
                raise ValueError(f"it has {name!r} twice")
            if member.flag_bits & 1 or member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise ValueError(f"{name!r} is encrypted, or compressed by other means than deflate")
            n_bytes -= member.compress_size
            if n_bytes < 0 or member.file_size > _MAX_DEFLATE * member.compress_size:
                raise ValueError(f"{name!r} promises {member.file_size} bytes, more than its part of the file can hold")
            self._members[name] = member

    def __enter__(self) -> NpzArrays:
        return self

    def __exit__(self, *_: object) -> None:
        self._archive.close()

    def __contains__(self, name: str) -> bool:
        return name in self._members

    def __getitem__(self, name: str) -> NDArray[Any]:
        """One array, read-only."""
        return self.read(name)

    def read(self, name: str, *, most_bytes: float = math.inf) -> NDArray[Any]:
        """One array of at most so many bytes, read-only."""
        if name not in self._members:
            raise ValueError(f"it has no array {name!r}")
        member = self._members[name]
        if member.file_size > most_bytes:
            raise ValueError(f"{name!r} has {member.file_size} bytes, more than {most_bytes:.0f}")
        with self._archive.open(member) as stream:
            dtype, is_fortran, shape, n_header = _header(stream, name)
            n_bytes = math.prod(shape) * dtype.itemsize
            if n_header + n_bytes != member.file_size or not dtype.itemsize:
                raise ValueError(f"{name!r} must have {n_bytes} bytes for its shape; got {member.file_size - n_header}")
            data = stream.read()
        if len(data) != n_bytes:
            raise ValueError(f"{name!r} ends after {len(data)} of {n_bytes} bytes")
        if dtype.kind == "U":
            points = np.frombuffer(data, np.dtype("u4").newbyteorder(dtype.byteorder))
            if ((points > sys.maxunicode) | ((points >= 0xD800) & (points < 0xE000))).any():
                raise ValueError(f"{name!r} holds numbers that are no characters")
        return np.frombuffer(data, dtype).reshape(shape, order="F" if is_fortran else "C")

    def text(self, name: str) -> str:
        """A single text."""
        array = self.read(name, most_bytes=_MOST_TEXT)
        if array.shape != () or array.dtype.kind != "U":
            raise ValueError(f"{name!r} must be one text; got shape {array.shape} of {array.dtype}")
        return str(array)


def _header(stream: Any, name: str) -> tuple[np.dtype[Any], bool, tuple[int, ...], int]:
    """Type, order, shape and length of the header of an .npy file, by its letters alone."""
    start = stream.read(8)
    width = 2 if start[6:7] == b"\x01" else 4
    if len(start) < 8 or start[:6] != b"\x93NUMPY" or start[6] not in (1, 2, 3):
        raise ValueError(f"{name!r} is not an array of NumPy")
    length = int.from_bytes(stream.read(width), "little")
    if length > _LONGEST_HEADER:
        raise ValueError(f"{name!r} has a header of {length} bytes")
    match = _HEADER.fullmatch(stream.read(length))
    if match is None:
        raise ValueError(f"{name!r} must be an array of numbers or text; its header says something else")
    shape = tuple(int(n) for n in match[3].replace(b" ", b"").split(b",") if n)
    if len(shape) > 8:
        raise ValueError(f"{name!r} has {len(shape)} axes")
    try:
        dtype = np.dtype(match[1].decode("ascii"))
    except TypeError:
        raise ValueError(f"{name!r} must be an array of numbers or text; got {match[1].decode('ascii')!r}") from None
    return dtype, match[2] == b"True", shape, 8 + width + length


def read_json(text: str | bytes) -> Any:
    """Read JSON; however deep it is, an error is a ValueError."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("its JSON is nested too deeply") from None


def is_shallow(value: Any, levels: int) -> bool:
    """Whether lists and mappings are nested no deeper than so many levels; looks no deeper."""
    if isinstance(value, dict | list):
        items: Any = value.values() if isinstance(value, dict) else value
        return levels > 0 and all(is_shallow(item, levels - 1) for item in items)
    return True
