"""Wavefront ``.obj``: `v` and `f` lines; groups, materials, lines, points and free-form curves are passed over."""

import re

import numpy as np

from voxkernel.mesh.ply import Polygons
from voxkernel.mesh.text_rows import TextLines, text_lines, whole_numbers

__all__ = ["PASSED_OVER", "parse_obj"]

PASSED_OVER = frozenset(
    "vt vn vp p l g s o mg usemtl mtllib usemap maplib cstype deg bmat step curv curv2 surf parm trim hole scrv sp end "
    "con bevel c_interp d_interp lod shadow_obj trace_obj ctech stech bsp bzp cdc cdp res".split()
)
_CORNERS = (r"[+-]?\d+", r"[+-]?\d+/[+-]?\d+", r"[+-]?\d+//[+-]?\d+", r"[+-]?\d+/[+-]?\d+/[+-]?\d+")
_FACE = re.compile("|".join(rf"\s*(?:{corner}(?:\s+|$))+" for corner in _CORNERS), re.ASCII)


def parse_obj(data: bytes) -> Polygons:
    """Vertices and faces; ValueError names the line that is wrong."""
    lines = text_lines(data, comment="#")
    if "\\" in "".join(lines.texts):
        lines = _joined(lines)
    vertices: list[str] = []
    faces: list[str] = []
    seen: list[int] = []
    vertex_lines: list[int] = []
    face_lines: list[int] = []
    for line, number in zip(lines.texts, lines.numbers.tolist(), strict=True):
        word, _, rest = line.strip().replace("\t", " ", 1).partition(" ")
        if word == "v":
            vertices.append(rest)
            vertex_lines.append(number)
        elif word in ("f", "fo"):
            if _FACE.fullmatch(rest) is None:
                raise ValueError(f"line {number}: a face has a corner that is not n, n/n, n//n or n/n/n, all alike")
            faces.append(rest)
            seen.append(len(vertices))
            face_lines.append(number)
        elif word not in PASSED_OVER:
            raise ValueError(f"line {number}: unknown word '{word[:40]}'")
    if any("/" in line for line in faces):
        faces = re.sub(r"/[^\s]*", "", "\n".join(faces)).split("\n")
    corners = TextLines(faces, np.array(face_lines, np.int64))
    values, sizes = corners.rows()
    flat = whole_numbers(values)
    before = np.repeat(np.array(seen, dtype=np.int64), sizes)
    lines_of = TextLines([], np.repeat(corners.numbers, sizes))
    lines_of.refuse(flat == 0, "vertex index 0 (they start at 1)")
    lines_of.refuse(flat < -before, "a relative vertex index reaches before the first vertex")
    lines_of.refuse(flat > len(vertices), f"a vertex index is beyond the {len(vertices)} vertices")
    points = TextLines(vertices, np.array(vertex_lines, np.int64))
    values, width = points.rows()
    points.refuse(width < 3, "a vertex has fewer than 3 coordinates")
    points.refuse(~np.isin(width, [3, 4, 6, 7]), "a vertex has neither 3 numbers, nor a weight, nor a colour")
    xyz = values[(np.cumsum(width) - width)[:, None] + np.arange(3)]
    return Polygons(xyz, np.where(flat > 0, flat - 1, before + flat), sizes)


def _joined(lines: TextLines) -> TextLines:
    """Lines that end in a backslash go on in the next one."""
    texts: list[str] = []
    numbers: list[int] = []
    parts: list[str] = []
    for text, number in zip(lines.texts, lines.numbers.tolist(), strict=True):
        if not parts:
            numbers.append(number)
        head = text.rstrip()
        parts.append(head.removesuffix("\\"))
        if not head.endswith("\\"):
            texts.append(" ".join(parts))
            parts = []
    if parts:
        raise ValueError(f"line {numbers[-1]}: it goes on, but the file ends")
    return TextLines(texts, np.array(numbers, np.int64))
