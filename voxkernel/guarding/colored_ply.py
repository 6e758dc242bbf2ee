"""A PLY file with a colour for each face, and a colour for each guard."""

from __future__ import annotations

import colorsys
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["UNSEEN", "piece_color", "write_colored_ply"]

UNSEEN = (211, 32, 47)
# Hues that look unlike each other and unlike the red of what is unseen; then they go round by the golden section.
_FIRST = (0.58, 0.11, 0.36, 0.78, 0.48, 0.16, 0.69, 0.27, 0.88, 0.53)
_GOLDEN = 0.6180339887498949


def piece_color(guard: int) -> tuple[int, int, int]:
    """Red, green and blue of a guard, 0 to 255; never near the red of what is unseen."""
    if guard < len(_FIRST):
        hue = _FIRST[guard]
    else:
        hue = 0.08 + 0.82 * ((guard * _GOLDEN) % 1.0)
    light = (0.58, 0.45, 0.7)[(guard // len(_FIRST)) % 3]
    red, green, blue = colorsys.hls_to_rgb(hue, light, 0.62)
    return round(255 * red), round(255 * green), round(255 * blue)


def write_colored_ply(
    path: str | os.PathLike[str],
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    colors: NDArray[np.uint8],
) -> None:
    """Write binary little-endian PLY, float64 and int32, with red, green and blue of each face."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("n", "u1"), ("v", "<i4", (3,)), ("c", "u1", (3,))])
    rows["n"], rows["v"], rows["c"] = 3, faces, colors
    Path(path).write_bytes(header.encode("ascii") + vertices.astype("<f8").tobytes() + rows.tobytes())
