"""Triangles as binary glTF (.glb): one mesh, positions in float32, nothing else."""

from __future__ import annotations

import json

import numpy as np
from numpy.typing import NDArray

__all__ = ["format_glb"]

_FLOAT, _UINT = 5126, 5125  # names of types in glTF
_POSITIONS, _INDICES = 34962, 34963  # what a part of the buffer is for


def format_glb(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> bytes:
    """Give the bytes of a file; axes are as they are, though glTF calls y up."""
    if np.abs(vertices).max(initial=0.0) > np.finfo(np.float32).max or len(vertices) > 2**32 - 2:
        raise ValueError("`vertices` must fit in float32 for .glb; got larger coordinates (use .ply)")
    points, indices = vertices.astype("<f4"), faces.astype("<u4")
    body = points.tobytes() + indices.tobytes()
    document = {
        "asset": {"version": "2.0", "generator": "voxkernel"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {
                "bufferView": 0, "componentType": _FLOAT, "count": len(points), "type": "VEC3",
                "min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": _UINT, "count": indices.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": points.nbytes, "target": _POSITIONS},
            {"buffer": 0, "byteOffset": points.nbytes, "byteLength": indices.nbytes, "target": _INDICES},
        ],
        "buffers": [{"byteLength": len(body)}],
    }  # fmt: skip
    text = json.dumps(document, separators=(",", ":")).encode("ascii")
    text += b" " * (-len(text) % 4)
    sizes = len(text).to_bytes(4, "little"), len(body).to_bytes(4, "little")
    whole = 12 + 8 + len(text) + 8 + len(body)
    head = b"glTF" + (2).to_bytes(4, "little") + whole.to_bytes(4, "little")
    return head + sizes[0] + b"JSON" + text + sizes[1] + b"BIN\0" + body
