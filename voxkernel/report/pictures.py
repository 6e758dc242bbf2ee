"""Thumbnails and 3D views of a run: which rows get one, read and checked, within a bound on their size."""

from __future__ import annotations

import base64
import posixpath
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._input_file import check_stored_file
from voxkernel._npz import DAMAGE, NpzArrays
from voxkernel.report.rows import ReportRows, worst_first

__all__ = ["Pictures", "collect", "spread_order"]

_KINDS = ((b"\x89PNG\r\n\x1a\n", "image/png"), (b"\xff\xd8\xff", "image/jpeg"))
_MOST_VERTICES = 2_000_000
_MOST_BYTES = 100 * _MOST_VERTICES  # of an array of a view


@dataclass(slots=True)
class Pictures:
    """What a page embeds: data by row, and what was left out and why."""

    thumbnails: dict[int, str] = field(default_factory=dict[int, str])
    views: dict[int, dict[str, Any]] = field(default_factory=dict[int, dict[str, Any]])
    n_bytes: int = 0
    thumbnails_left_out: int = 0
    views_left_out: int = 0
    unreadable: list[tuple[str, str]] = field(default_factory=list[tuple[str, str]])


def collect(run: str, rows: ReportRows, *, n_views: int, max_bytes: int, first: Sequence[int] = ()) -> Pictures:
    """Read views, then thumbnails, until `max_bytes` of the page are used.

    Rows in `first` come first, then rows spread over labels, outcomes and scores, so that a part of them shows the
    whole. A file that is missing, damaged, or outside the run is noted and left out.
    """
    from voxkernel.run_table import open_run

    fs, base = open_run(run)
    found = Pictures()
    order = _unique([*first, *spread_order(rows)])
    # Views too large for the page are passed over, but not all views of a run are read for a few.
    with_view = [i for i in order if rows.texts["view"][i]][: 4 * n_views + 16]
    for i in with_view:
        if len(found.views) >= n_views:
            break
        view = _guarded(found, rows.texts["view"][i], fs, base, _view)
        if view is not None and not _fits(found, sum(len(v) for v in view.values() if isinstance(v, str)), max_bytes):
            found.views_left_out += 1
        elif view is not None:
            found.views[i] = view
    # A shape that can be turned should have its picture.
    pictured = [i for i in _unique([*found.views, *order]) if rows.texts["thumbnail"][i]]
    for k, i in enumerate(pictured):
        image = _guarded(found, rows.texts["thumbnail"][i], fs, base, _image)
        if image is None:
            continue
        if not _fits(found, len(image), max_bytes):
            found.thumbnails_left_out = len(pictured) - k
            break
        found.thumbnails[i] = image
    return found


def spread_order(rows: ReportRows) -> list[int]:
    """Order rows so that every beginning shows all labels and outcomes, and from worst to best within each."""
    groups: dict[tuple[str, str], list[int]] = {}
    for i, key in enumerate(zip(rows.texts["label"], rows.outcome, strict=True)):
        groups.setdefault(key, []).append(i)
    queues = [_ends_first(worst_first(rows, groups[key])) for key in sorted(groups)]
    longest = max((len(queue) for queue in queues), default=0)
    return [queue[k] for k in range(longest) for queue in queues if k < len(queue)]


def _ends_first(ids: list[int]) -> list[int]:
    """First, last, middle, quarters, and so on."""
    n = len(ids)
    places = [0, n - 1]
    parts = 2
    while parts < 2 * n:
        places += [round(k * (n - 1) / parts) for k in range(1, parts, 2)]
        parts *= 2
    return [ids[k] for k in _unique(places)] + [ids[k] for k in sorted(set(range(n)) - set(places))]


def _unique(items: Iterable[int]) -> list[int]:
    return list(dict.fromkeys(items))


def _fits(found: Pictures, size: int, max_bytes: int) -> bool:
    if found.n_bytes + size > max_bytes:
        return False
    found.n_bytes += size
    return True


def _guarded(found: Pictures, relative: str, fs: Any, base: str, decode: Callable[[bytes], Any]) -> Any:
    """Read one file of the run; whatever is wrong with it costs its picture, not the report."""
    try:
        name = _inside(base, relative)
        check_stored_file(fs, name)
        return decode(fs.cat_file(name))
    except (OSError, ValueError, KeyError, EOFError, MemoryError, SyntaxError) as error:
        found.unreadable.append((relative, str(error) or type(error).__name__))
        return None


def _inside(base: str, relative: str) -> str:
    """Join a path of the table to the run; it must not lead out of it."""
    path = posixpath.normpath(relative)
    if path.startswith(("/", "..")) or "\\" in path or "://" in relative or ":" in path.split("/")[0]:
        raise ValueError("the path leads out of the run")
    return posixpath.join(base, path)


def _image(data: bytes) -> str:
    for magic, kind in _KINDS:
        if data.startswith(magic):
            return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
    raise ValueError("it is no PNG or JPEG picture")


def _view(data: bytes) -> dict[str, Any]:
    """Check the arrays of a view and write them as base64 little-endian float32 and uint32."""
    try:
        with NpzArrays(data) as arrays:
            surface = _mesh(arrays, "vertices", "faces")
            kernel = _mesh(arrays, "kernel_vertices", "kernel_faces")
    except DAMAGE as error:
        raise ValueError(f"it is no .npz file of a view: {str(error) or type(error).__name__}") from None
    if not len(surface[1]):
        raise ValueError("it has no faces")
    return {
        "vertices": _base64(surface[0]), "faces": _base64(surface[1]),
        "kernel_vertices": _base64(kernel[0]), "kernel_faces": _base64(kernel[1]), "n_faces": len(surface[1]),
    }  # fmt: skip


def _mesh(arrays: NpzArrays, name: str, faces: str) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    points = np.asarray(arrays.read(name, most_bytes=_MOST_BYTES), dtype="<f4").reshape(-1, 3)
    triangles = arrays.read(faces, most_bytes=_MOST_BYTES).reshape(-1, 3)
    if len(points) > _MOST_VERTICES:
        raise ValueError(f"`{name}` must have at most {_MOST_VERTICES:,} rows; got {len(points):,}")
    if not np.isfinite(points).all():
        raise ValueError(f"`{name}` must be finite")
    if triangles.size and (triangles.dtype.kind not in "iu" or triangles.min() < 0 or triangles.max() >= len(points)):
        raise ValueError(f"faces must be indices of `{name}`")
    return points, triangles.astype("<u4")


def _base64(array: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
