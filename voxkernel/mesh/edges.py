"""The edges of triangles, paired: which are on the border, are they oriented, which loops they form."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import read_only
from voxkernel.mesh.connected_components import components

__all__ = ["HalfEdges", "are_oriented", "edge_parts", "half_edges", "loops_of"]


class HalfEdges(NamedTuple):
    """Half-edges sorted by edge; half-edge h runs from corner h % 3 of triangle h // 3 to the next."""

    order: NDArray[np.int64]  # half-edge ids, those of one edge together
    first: NDArray[np.int64]  # (e,) where each edge starts in `order`
    n_faces: NDArray[np.int64]  # (e,) triangles at each edge
    forward: NDArray[np.bool_]  # per entry of `order`: from the smaller to the larger vertex id?

    def ends(self, faces: NDArray[np.int64]) -> NDArray[np.int64]:
        """(e, 2) vertex ids of every edge, the smaller first; in lexicographic order."""
        some = self.order[self.first]
        tail, head = faces.reshape(-1)[some], faces[:, [1, 2, 0]].reshape(-1)[some]
        return np.stack([np.minimum(tail, head), np.maximum(tail, head)], axis=1)

    def pairs(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The two half-edges of every edge where exactly two triangles meet."""
        at = self.first[self.n_faces == 2]
        return self.order[at], self.order[at + 1]

    def numbers(self) -> NDArray[np.int64]:
        """(3 m,) the edge of every half-edge."""
        edge = np.empty(len(self.order), dtype=np.int64)
        edge[self.order] = np.repeat(np.arange(len(self.first)), self.n_faces)
        return edge


def half_edges(faces: NDArray[np.int64], n_vertices: int) -> HalfEdges:
    """One sort gives every edge fact."""
    tail, head = faces.reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    forward = tail < head
    keys = np.where(forward, tail * n_vertices + head, head * n_vertices + tail)
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    first = np.flatnonzero(np.concatenate([[True], keys[1:] != keys[:-1]]))
    count = np.diff(np.append(first, len(keys)))
    return HalfEdges(order, first, count, forward[order])


def edge_parts(edges: HalfEdges, n_faces: int) -> tuple[int, NDArray[np.int32]]:
    """Number of parts that share no edge, and the part of each triangle: each has a volume of its own."""
    linked = np.ones(len(edges.order), dtype=bool)
    linked[edges.first] = False
    to = np.flatnonzero(linked)
    a, b = edges.order[to - 1] // 3, edges.order[to] // 3
    return components(n_faces, a, b)


def are_oriented(edges: HalfEdges) -> bool:
    """Do the directions balance at every edge that has more than one triangle?"""
    forward = np.add.reduceat(edges.forward.astype(np.int64), edges.first)
    return bool((np.abs(2 * forward - edges.n_faces) <= edges.n_faces % 2).all())


def loops_of(tails: NDArray[np.int64], heads: NDArray[np.int64]) -> tuple[NDArray[np.int64], ...]:
    """Chain boundary half-edges into simple loops, in order of their lowest half-edge."""
    if len(tails) == 0:
        return ()
    ordered = np.sort(tails)
    if (ordered[1:] != ordered[:-1]).all() and np.array_equal(ordered, np.sort(heads)):
        return _cycles(tails, heads)
    return _chains(tails, heads)


def _cycles(tails: NDArray[np.int64], heads: NDArray[np.int64]) -> tuple[NDArray[np.int64], ...]:
    """The usual case: one way in and one way out at every boundary vertex."""
    edge_from = np.empty(int(tails.max()) + 1, dtype=np.int64)
    edge_from[tails] = np.arange(len(tails))
    following = edge_from[heads].tolist()
    waiting = [True] * len(following)
    order: list[int] = []
    starts: list[int] = []
    for edge in range(len(following)):
        if waiting[edge]:
            starts.append(len(order))
            while waiting[edge]:
                waiting[edge] = False
                order.append(edge)
                edge = following[edge]
    vertices = read_only(tails[order])
    return tuple(vertices[a:b] for a, b in pairwise([*starts, len(order)]))


def _chains(tails: NDArray[np.int64], heads: NDArray[np.int64]) -> tuple[NDArray[np.int64], ...]:
    """Pinched or unoriented boundaries: against a half-edge only where none goes on forward."""
    outgoing: dict[int, list[int]] = {}
    incoming: dict[int, list[int]] = {}
    a, b = tails.tolist(), heads.tolist()
    for edge, (tail, head) in enumerate(zip(a, b, strict=True)):
        outgoing.setdefault(tail, []).append(edge)
        incoming.setdefault(head, []).append(edge)
    used = [False] * len(a)
    loops: list[NDArray[np.int64]] = []

    def step(vertex: int) -> int | None:
        for table, ends in ((outgoing, b), (incoming, a)):
            waiting = table.get(vertex, [])
            while waiting:
                edge = waiting.pop()
                if not used[edge]:
                    used[edge] = True
                    return ends[edge]
        return None

    for edge, start in enumerate(a):
        if used[edge]:
            continue
        path, place = [start], {start: 0}
        while (vertex := step(path[-1])) is not None:
            if vertex in place:  # a simple loop is closed: take it off the path
                at = place[vertex]
                loops.append(read_only(np.array(path[at:], dtype=np.int64)))
                for gone in path[at + 1 :]:
                    del place[gone]
                del path[at + 1 :]
            else:
                place[vertex] = len(path)
                path.append(vertex)
        if len(path) > 1:
            loops.append(read_only(np.array(path, dtype=np.int64)))
    return tuple(loops)
