"""A PLY file with a colour for each face."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["write_colored_ply"]


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
