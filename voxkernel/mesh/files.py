"""Surface files: polygons, float64 coordinates and order as they stand in the file.

``.off`` and ``.obj`` have parsers of their own because no library keeps all three: meshio 5.3 reads only
triangles from ``.off`` and no relative indices from ``.obj``; VTK and Open3D round to float32 or renumber
the vertices. PyMeshLab reads everything else.
"""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import equal_corners
from voxkernel._input_file import input_file
from voxkernel._vtk_xml import write_polygons
from voxkernel.errors import MeshReadError
from voxkernel.mesh.glb import format_glb
from voxkernel.mesh.obj import parse_obj
from voxkernel.mesh.off import parse_off
from voxkernel.mesh.ply import Polygons, format_ply, parse_ply
from voxkernel.mesh.stl import parse_stl
from voxkernel.mesh.triangles import unit_normals
from voxkernel.mesh.usual_files import read_usual
from voxkernel.mesh.vtp import parse_vtp

__all__ = ["Polygons", "merge_equal_corners", "read_polygons", "write_triangles"]

_MESHLAB_SUFFIXES = tuple(".3ds .3mf .ctm .dae .fbx .glb .gltf .tri .vmi .wrl .x3d .x3dv".split())


def read_polygons(path: str | os.PathLike[str]) -> Polygons:
    """Read a file by its suffix; every failure is a MeshReadError of one line that names the file."""
    file = input_file(path, MeshReadError)
    suffix = file.suffix.lower()
    parsers = {".ply": parse_ply, ".off": parse_off, ".obj": parse_obj, ".stl": parse_stl, ".vtp": parse_vtp}
    if suffix not in parsers and suffix not in _MESHLAB_SUFFIXES:
        known = " ".join(sorted((*parsers, *_MESHLAB_SUFFIXES)))
        raise MeshReadError(f"`path` must end in one of {known}; got '{file}'")
    try:
        if suffix in parsers:
            usual = read_usual(file)
            if usual is not None and len(usual.sizes):
                return usual
            data = file.read_bytes()
            empty = not data.strip()
        else:
            data, empty = b"", file.stat().st_size == 0
    except OSError as error:
        raise MeshReadError(f"'{file}' cannot be read: {error.strerror or error}") from error
    except MemoryError as error:
        raise MeshReadError(f"'{file}' cannot be read: it is too large for the memory") from error
    if empty:
        raise MeshReadError(f"'{file}' cannot be read: the file is empty")
    if suffix not in parsers:
        from voxkernel.mesh.other_formats import read_with_meshlab

        vertices, faces = read_with_meshlab(file)
        return Polygons(vertices, faces.reshape(-1), np.full(len(faces), 3))
    try:
        return parsers[suffix](data)
    except (ValueError, OverflowError, MemoryError) as error:
        raise MeshReadError(f"'{file}' is not a readable {suffix} file: {_one_line(str(error))}") from error


def _one_line(text: str) -> str:
    return " ".join(text.split())[:300]


def merge_equal_corners(soup: Polygons) -> Polygons:
    """Give equal positions one vertex, in the order of first appearance: STL has no other way to share."""
    vertices, ids = equal_corners(np.ascontiguousarray(soup.vertices))
    return Polygons(vertices, ids[soup.flat], soup.sizes)


def write_triangles(
    path: str | os.PathLike[str], vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> None:
    """Write one of six formats; .stl and .glb round to float32, the others keep float64 exactly."""
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix == ".ply":
        file.write_bytes(format_ply(vertices, faces))
    elif suffix == ".stl":
        file.write_bytes(_format_stl(vertices, faces))
    elif suffix == ".off":
        head = f"OFF\n{len(vertices)} {len(faces)} 0\n"
        file.write_text(head + _rows("%.17g %.17g %.17g\n", vertices) + _rows("3 %d %d %d\n", faces))
    elif suffix == ".obj":
        file.write_text(_rows("v %.17g %.17g %.17g\n", vertices) + _rows("f %d %d %d\n", faces + 1))
    elif suffix == ".vtp":
        write_polygons(file, vertices, faces.reshape(-1), np.full(len(faces), 3))
    elif suffix == ".glb":
        file.write_bytes(format_glb(vertices, faces))
    else:
        raise ValueError(f"`path` must end in one of .glb .obj .off .ply .stl .vtp; got '{file}'")


def _rows(pattern: str, table: NDArray[np.generic]) -> str:
    """Every row in a text pattern, thousands of rows a call."""
    parts = (table[start : start + 4096] for start in range(0, len(table), 4096))
    return "".join(pattern * len(part) % tuple(part.reshape(-1).tolist()) for part in parts)


def _format_stl(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> bytes:
    """Binary STL; coordinates are rounded to float32."""
    if np.abs(vertices).max() > np.finfo(np.float32).max:
        raise ValueError("`vertices` must fit in float32 for .stl; got larger coordinates (use .ply)")
    rows = np.zeros(
        len(faces), dtype=[("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    )
    corners = vertices[faces]
    rows["normal"] = unit_normals(corners)
    rows["corners"] = corners
    return bytes(80) + len(faces).to_bytes(4, "little") + rows.tobytes()
