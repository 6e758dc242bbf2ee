"""VTK's XML files of polygons (.vtp) and of hexahedra (.vtu), written without VTK: numbers as they are in memory."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._output_file import whole_file

__all__ = ["write_hexahedra", "write_polygons"]

_HEXAHEDRON = 12
_THREE = ' NumberOfComponents="3"'
_NAMES = {"i": "Int", "u": "UInt", "f": "Float"}


def write_polygons(
    path: str | os.PathLike[str],
    points: NDArray[np.float64],
    flat: NDArray[np.int64],
    sizes: NDArray[np.int64],
    *,
    cell_data: Mapping[str, NDArray[Any]] | None = None,
) -> None:
    """Write polygons, one after another in `flat`, with numbers for each of them."""
    cells = {"connectivity": flat, "offsets": np.cumsum(sizes)}
    _write(path, "PolyData", f'NumberOfPolys="{len(sizes)}"', points, "Polys", cells, cell_data or {})


def write_hexahedra(
    path: str | os.PathLike[str], corners: NDArray[np.float64], *, cell_data: Mapping[str, NDArray[Any]]
) -> None:
    """Write hexahedra, (n, 8, 3) in VTK's order of corners, each with corners of its own."""
    n = len(corners)
    cells = {
        "connectivity": np.arange(8 * n, dtype=np.int64),
        "offsets": np.arange(8, 8 * n + 8, 8, dtype=np.int64),
        "types": np.full(n, _HEXAHEDRON, np.uint8),
    }
    points = corners.reshape(-1, 3)
    _write(path, "UnstructuredGrid", f'NumberOfCells="{n}"', points, "Cells", cells, cell_data)


def _write(
    path: str | os.PathLike[str],
    kind: str,
    count: str,
    points: NDArray[np.float64],
    section: str,
    cells: Mapping[str, NDArray[Any]],
    cell_data: Mapping[str, NDArray[Any]],
) -> None:
    """One piece; all arrays stand behind the text, each after its size."""
    arrays: list[NDArray[Any]] = []
    at = 0

    def described(name: str, array: NDArray[Any], more: str = "") -> str:
        nonlocal at
        kept = np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<"))
        arrays.append(kept)
        type_name = f"{_NAMES[kept.dtype.kind]}{8 * kept.dtype.itemsize}"
        text = f'<DataArray type="{type_name}" Name="{name}"{more} format="appended" offset="{at}"/>\n'
        at += 8 + kept.nbytes
        return text

    head = (
        f'<?xml version="1.0"?>\n<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
        f'<{kind}><Piece NumberOfPoints="{len(points)}" {count}>\n'
        f"<Points>{described('Points', points, _THREE)}</Points>\n"
        f"<{section}>{''.join(described(name, array) for name, array in cells.items())}</{section}>\n"
        f"<CellData>{''.join(described(name, array) for name, array in cell_data.items())}</CellData>\n"
        f'</Piece></{kind}>\n<AppendedData encoding="raw">\n_'
    )
    with whole_file(path) as stream:
        stream.write(head.encode("ascii"))
        for array in arrays:
            stream.write(array.nbytes.to_bytes(8, "little"))
            stream.write(array.tobytes())
        stream.write(b"\n</AppendedData></VTKFile>\n")
