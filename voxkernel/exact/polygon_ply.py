"""Polygons as binary .ply, each with the input facet it came from."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["write_polygon_ply"]


def write_polygon_ply(
    path: str | os.PathLike[str],
    vertices: NDArray[np.float64],
    faces: Sequence[NDArray[np.int64]],
    facets: NDArray[np.int64],
) -> None:
    """Write polygons with one number each, `input_facet`; no vertices at all make a file of none."""
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment voxkernel kernel\n"
        f"element vertex {len(vertices)}\nproperty double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\nproperty list int int vertex_indices\nproperty int input_facet\n"
        "end_header\n"
    )
    rows = [np.concatenate([[len(face)], face, [facet]]) for face, facet in zip(faces, facets, strict=True)]
    body = np.concatenate(rows).astype("<i4").tobytes() if rows else b""
    Path(path).write_bytes(header.encode("ascii") + vertices.astype("<f8").tobytes() + body)
