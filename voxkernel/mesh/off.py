"""Object File Format: ``OFF`` with or without normals, colours, texture; `#` comments."""

import re

import numpy as np

from voxkernel.mesh.ply import Polygons
from voxkernel.mesh.text_rows import ranges, text_lines, whole_numbers

__all__ = ["parse_off"]


def parse_off(data: bytes) -> Polygons:
    """Vertices and faces; ValueError names the line that is wrong."""
    head = re.match(rb"\s*(?:#[^\r\n]*\s*)*(?:ST)?C?N?OFF[ \t]+BINARY", data)
    if head is not None:
        raise ValueError("binary OFF is not supported")
    lines = text_lines(data, comment="#")
    if not lines.texts:
        raise ValueError("it holds only comments")
    words = lines.texts[0].split()
    letters = re.fullmatch(r"(ST)?(C)?(N)?OFF", words[0])
    if letters is None:
        raise ValueError("it does not start with 'OFF'")
    at = 0 if words[1:] else 1
    counts = words[1:] or (lines.texts[1].split() if len(lines.texts) > 1 else [])
    if len(counts) != 3 or not all(re.fullmatch(r"[0-9]{1,18}", word) for word in counts):
        number = lines.numbers[min(at, len(lines.texts) - 1)]
        raise ValueError(f"line {number}: it must hold the numbers of vertices, faces and edges")
    n_vertices, n_faces = int(counts[0]), int(counts[1])
    first, middle, end = at + 1, at + 1 + n_vertices, at + 1 + n_vertices + n_faces
    if len(lines.texts) < end:
        raise ValueError(f"it ends before its {n_vertices} vertices and {n_faces} faces do")
    if len(lines.texts) > end:
        raise ValueError(f"line {lines.numbers[end]}: it follows the last face")
    rows = lines.part(first, middle)
    values, width = rows.rows()
    rows.refuse(width < 3, "a vertex has fewer than 3 coordinates")
    texture, colour, normal = letters.groups()
    least = 3 + (2 if texture else 0) + (3 if normal else 0)
    if n_vertices:
        allowed = [least, least + 3, least + 4] if colour else [least]
        rows.refuse(~np.isin(width, allowed), f"a vertex of {words[0]} has the wrong number of numbers")
        rows.refuse(width != width[0], "a vertex has other numbers than the first one")
    vertices = values[(np.cumsum(width) - width)[:, None] + np.arange(3)]
    rows = lines.part(middle, end)
    values, width = rows.rows()
    starts = np.cumsum(width) - width
    counted = values[starts]
    rows.refuse(~((counted >= 0) & (counted == np.trunc(counted))), "a face does not start with its number of indices")
    rows.refuse(counted >= width, "a face has fewer indices than it says")
    sizes = whole_numbers(counted)
    extra = width - 1 - sizes
    rows.refuse(~np.isin(extra, [0, 1, 3, 4]), "a face has more indices than it says, or a colour that is none")
    return Polygons(vertices, whole_numbers(values[ranges(starts + 1, sizes)]), sizes)
