"""Text of Medit's .mesh: vertices and cells of four kinds; every other section is checked and passed over."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from voxkernel.polyhedral.text_numbers import as_count, as_numbers, as_whole, split_lines

__all__ = ["parse_medit"]

# Optional sections of surfaces, marks, normals and geometry, with a count; and those of a few numbers without one.
_PASSED_OVER = frozenset(
    """edges triangles quadrilaterals corners ridges normals tangents requiredvertices requirededges requiredtriangles
    requiredquadrilaterals requiredtetrahedra requiredhexahedra requiredprisms requiredpyramids normalatvertices
    normalattrianglevertices normalatquadrilateralvertices tangentatvertices tangentatedges tangentatedgevertices
    parallelvertices paralleledges paralleltriangles parallelquadrilaterals subdomain subdomainfromgeom
    subdomainfrommesh vertexongeometricvertex vertexongeometricedge vertexongeometrictriangle
    vertexongeometricquadrilateral edgeongeometricedge""".split()
)
_WITHOUT_COUNT = {"angleofcornerbound": 1, "boundingbox": 6, "iterations": 1, "time": 1}


class _Words:
    """The words of a file, the line of each, and a place among them."""

    def __init__(self, text: str) -> None:
        lines = split_lines(text)
        self.words = [word for line in lines for word in line]
        self.line_of = np.repeat(np.arange(1, len(lines) + 1), [len(line) for line in lines])
        self.at = 0

    def __bool__(self) -> bool:
        return self.at < len(self.words)

    def take(self, what: str) -> tuple[str, int]:
        """The next word and its line."""
        if not self:
            raise ValueError(f"it ends where {what} must be")
        self.at += 1
        return self.words[self.at - 1], int(self.line_of[self.at - 1])

    def count(self, what: str) -> int:
        """The number of rows of a section."""
        word, line = self.take(f"the number of {what}")
        return as_count(word, line, what)

    def rows(self, n: int, columns: int, what: str) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """The next rows and their lines; nothing is made before the file is known to hold so many words."""
        end = self.at + n * columns
        if end > len(self.words):
            raise ValueError(f"it ends before its {n} {what} do")
        lines = self.line_of[self.at : end].reshape(n, columns)
        broken = np.flatnonzero(lines[:, 0] != lines[:, -1])
        n_whole = int(broken[0]) if len(broken) else n
        table = as_numbers(self.words[self.at : self.at + n_whole * columns], lines[:n_whole].reshape(-1))
        if n_whole < n:
            raise ValueError(f"line {lines[n_whole, 0]}: a row of {what} must have {columns} numbers on one line")
        self.at = end
        return table.reshape(n, columns), lines[:, 0]

    def pass_over(self, n: int, what: str) -> None:
        """Go to the next keyword: the numbers before it must be rows of one length."""
        begin, line = self.at, self.line_of[self.at - 1]
        while self and not self.words[self.at][0].isalpha():
            self.at += 1
        size = self.at - begin
        as_numbers(self.words[begin : self.at], self.line_of[begin : self.at])
        if (size % n or not size) if n else size:
            raise ValueError(f"line {line}: {what} must have {n} rows of one length; got {size} numbers")


def parse_medit(text: str, kinds: Mapping[str, int]) -> tuple[NDArray[np.float64], list[tuple[str, NDArray[np.int64]]]]:
    """Vertices, and per kind of cell, in the order of the file, its table of vertex ids, from 0.

    `kinds` maps the keywords of cells to the number of their corners. A file is keywords, counts and rows of numbers
    that end with a reference. A row may not go on in the next line, so that one too short and one too long are not
    taken for two others.
    """
    source = _Words(text)
    if not source or source.words[0].lower() not in ("meshversionformatted", "meshversionunformatted"):
        raise ValueError("line 1: it does not start with 'MeshVersionFormatted'")
    vertices = np.zeros((0, 3))
    tables: list[tuple[str, NDArray[np.float64], NDArray[np.int64]]] = []
    seen: set[str] = set()
    while source:
        name, line = source.take("a keyword")
        word = name.lower()
        if word in seen:
            raise ValueError(f"line {line}: there is a second section {name}")
        seen.add(word)
        if word.startswith("meshversion"):
            source.count("the version")
        elif word == "dimension":
            if (dimension := source.count("dimensions")) != 3:
                raise ValueError(f"line {line}: its dimension is {dimension}, not 3")
        elif word == "vertices":
            vertices = source.rows(source.count(name), 4, name)[0][:, :3]
        elif word in kinds:
            rows, lines = source.rows(source.count(name), kinds[word] + 1, name)
            tables.append((word, rows[:, :-1], lines))
        elif word in _PASSED_OVER:
            source.pass_over(source.count(name), name)
        elif word in _WITHOUT_COUNT:
            source.rows(1, _WITHOUT_COUNT[word], name)
        elif word == "end":
            if source:
                raise ValueError(f"line {source.take('')[1]}: there is more after 'End'")
        else:
            raise ValueError(f"line {line}: a keyword of the format must be here; got '{name[:40]}'")
    return vertices, [(word, _ids(rows, lines, len(vertices))) for word, rows, lines in tables]


def _ids(rows: NDArray[np.float64], lines: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Vertex numbers of the file, from 1, as ids from 0."""
    flat = as_whole(rows.reshape(-1), np.repeat(lines, rows.shape[1]), 1, n, "vertex number")
    return flat.reshape(rows.shape) - 1
