"""VTK's XML files of polygons (.vtp): points of all pieces in a row, polygons as they are."""

import numpy as np
from numpy.typing import NDArray

from voxkernel._vtk_arrays import check_points, count_of, indices_of, open_pieces, points_of, row_starts
from voxkernel.mesh.ply import Polygons

__all__ = ["parse_vtp"]


def parse_vtp(data: bytes) -> Polygons:
    """Polygons of a file; points and lines are passed over, strips are refused."""
    pieces, source = open_pieces(data, "PolyData")
    points: list[NDArray[np.float64]] = []
    flats: list[NDArray[np.int64]] = []
    sizes: list[NDArray[np.int64]] = []
    first = 0
    for piece in pieces:
        if piece.get("NumberOfStrips", "0") != "0":
            raise ValueError(f"it has {piece.get('NumberOfStrips')} triangle strips (triangulate first)")
        points.append(points_of(piece, source))
        n_polygons = count_of(piece, "NumberOfPolys") if "NumberOfPolys" in piece.keys() else 0
        found = indices_of(piece, "Polys", source)
        if n_polygons:
            for name in ("connectivity", "offsets"):
                if name not in found:
                    raise ValueError(f"there is no array '{name}'")
            flat = found["connectivity"]
            sizes.append(np.diff(row_starts(found, "offsets", n_polygons, len(flat))))
            check_points(flat, "connectivity", len(points[-1]))
            flats.append(flat + first)
        first += len(points[-1])
    none = np.zeros(0, np.int64)
    return Polygons(np.concatenate(points), np.concatenate([none, *flats]), np.concatenate([none, *sizes]))
