"""Small pictures for notebooks, made of NumPy and zlib alone: samples of a surface, the nearest in each pixel."""

from __future__ import annotations

import struct
import zlib
from base64 import b64encode

import numpy as np
from numpy.typing import NDArray

__all__ = ["BLUE", "ORANGE", "PURPLE", "curve_svg", "thumbnail"]

BLUE, ORANGE, PURPLE = (127, 176, 230), (255, 122, 20), (163, 74, 156)  # surfaces, exact and relaxed kernels

_SIZE = 200, 150  # pixels
_SAMPLES = 120_000
_MOST_FACES = 2_000_000
# Right, up and towards the viewer; the light comes from above the viewer's left shoulder.
_TOWARDS = np.array([0.5, -0.75, 0.45]) / np.linalg.norm([0.5, -0.75, 0.45])
_RIGHT = np.cross([0.0, 0.0, 1.0], _TOWARDS) / np.linalg.norm(np.cross([0.0, 0.0, 1.0], _TOWARDS))
_FRAME = np.stack([_RIGHT, np.cross(_TOWARDS, _RIGHT), _TOWARDS])
_LIGHT = np.array([-0.35, 0.55, 0.75]) / np.linalg.norm([-0.35, 0.55, 0.75])


def thumbnail(vertices: NDArray[np.float64], faces: NDArray[np.int64], color: tuple[int, int, int]) -> str:
    """Draw triangles as an ``<img>`` of a few kilobytes; "" where there are none, or too many."""
    if not 0 < len(faces) <= _MOST_FACES:
        return ""
    used = vertices[np.unique(faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    scale = float((high - low).max())
    if not 0.0 < scale < np.inf:
        return ""
    corners = ((vertices - 0.5 * (low + high)) / scale @ _FRAME.T)[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    # Evenly over the area that is seen, in a fixed order: the same surface gives the same picture.
    ends = np.cumsum(np.abs(normals[:, 2]) + 1e-3 * areas)
    if not ends[-1] > 0.0:
        return ""
    ids = np.searchsorted(ends, (np.arange(_SAMPLES) + 0.5) * (ends[-1] / _SAMPLES), side="right")
    ids = np.minimum(ids, len(faces) - 1)
    u, v = np.random.default_rng(0).random((2, _SAMPLES))
    beyond = u + v > 1.0
    u[beyond], v[beyond] = 1.0 - u[beyond], 1.0 - v[beyond]
    a, b, c = np.moveaxis(corners[ids], 1, 0)
    points = a + u[:, None] * (b - a) + v[:, None] * (c - a)
    # Both sides of a facet are lit: a surface may be open.
    units = normals / np.where(areas > 0.0, areas, 1.0)[:, None]
    units *= np.where(units[:, 2:] < 0.0, -1.0, 1.0)
    shade = 0.45 + 0.55 * np.clip(units @ _LIGHT, 0.0, 1.0)
    return _image(_nearest(points, shade[ids], corners), color)


def curve_svg(x: NDArray[np.float64], y: NDArray[np.float64], color: str) -> str:
    """Draw a rising curve over its own range, as SVG."""
    width, height = 200.0, 70.0
    across, up = float(x.max() - x.min()) or 1.0, float(y.max()) or 1.0
    places = " ".join(
        f"{4 + (width - 8) * (a - x.min()) / across:.1f},{height - 4 - (height - 8) * b / up:.1f}"
        for a, b in zip(x.tolist(), y.tolist(), strict=True)
    )
    return (
        f'<svg width="{width:g}" height="{height:g}" role="img" aria-label="curve">'
        f'<polyline points="{places}" fill="none" stroke="{color}" stroke-width="2"></polyline></svg>'
    )


def _nearest(
    points: NDArray[np.float64], shade: NDArray[np.float64], corners: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The shade of the sample nearest to the viewer in each pixel, NaN where there is none."""
    width, height = _SIZE
    flat = corners[..., :2].reshape(-1, 2)
    low, high = flat.min(axis=0), flat.max(axis=0)
    pixel = max(float((high[0] - low[0]) / (width - 8)), float((high[1] - low[1]) / (height - 8)))
    middle = 0.5 * (low + high)
    column = np.clip((points[:, 0] - middle[0]) / pixel + 0.5 * width, 0, width - 1).astype(np.int64)
    row = np.clip(0.5 * height - (points[:, 1] - middle[1]) / pixel, 0, height - 1).astype(np.int64)
    order = np.argsort(points[:, 2], kind="stable")  # the last one written stays
    found = np.full(width * height, np.nan)
    found[(row * width + column)[order]] = shade[order]
    return _filled(found.reshape(height, width))


def _filled(shades: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give pixels that no sample hit, but three of their neighbours, the mean of those."""
    around = np.pad(shades, 1, constant_values=np.nan)
    sides = np.stack([around[:-2, 1:-1], around[2:, 1:-1], around[1:-1, :-2], around[1:-1, 2:]])
    counts = (~np.isnan(sides)).sum(axis=0)
    means = np.nansum(sides, axis=0) / np.maximum(counts, 1)
    return np.where(np.isnan(shades) & (counts >= 3), means, shades)


def _image(shades: NDArray[np.float64], color: tuple[int, int, int]) -> str:
    """Shades of one colour as PNG with a palette: 0 is clear."""
    levels = np.where(np.isnan(shades), 0, 1 + np.round(62 * np.nan_to_num(shades))).astype(np.uint8)
    palette = np.round(np.arange(63)[:, None] / 62 * np.array(color)).astype(np.uint8)
    rows = np.pad(levels, ((0, 0), (1, 0)))  # each row begins with its filter: none
    height, width = shades.shape
    parts = (
        (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)),
        (b"PLTE", bytes([255, 255, 255]) + palette.tobytes()), (b"tRNS", b"\0"),
        (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""),
    )  # fmt: skip
    data = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body)) for name, body in parts
    )
    source = f"data:image/png;base64,{b64encode(data).decode()}"
    return f'<img alt="picture" width="{width}" height="{height}" src="{source}">'
