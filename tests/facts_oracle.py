"""Facts of a surface by sorted edge keys, SciPy's components and dictionaries: slow, without the compiled core."""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from voxkernel.mesh.triangles import triangle_areas, triple_products
from voxkernel.mesh.zero_area import exact_integers, is_degenerate

__all__ = ["boundary_chains", "facts_of"]


def components(n, rows, columns):
    """Count the parts of a graph and label its nodes."""
    graph = coo_matrix((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(n, n))
    return connected_components(graph, directed=False)


def sorted_edges(faces, n_vertices):
    """Half-edges ordered by edge; where each edge starts; its number of faces; how many run forward."""
    tail, head = faces.reshape(-1), faces[:, [1, 2, 0]].reshape(-1)
    keys = np.minimum(tail, head) * n_vertices + np.maximum(tail, head)
    order = np.argsort(keys, kind="stable")
    _, first, count = np.unique(keys[order], return_index=True, return_counts=True)
    return order, first, count, np.add.reduceat((tail < head)[order].astype(int), first)


def has_one_fan(order, first, faces):
    """One fan of triangles round every vertex of a closed surface?"""
    left, right = order[first], order[first + 1]
    next_left, next_right = left - left % 3 + (left + 1) % 3, right - right % 3 + (right + 1) % 3
    rows, columns = np.concatenate([left, next_left]), np.concatenate([next_right, right])
    return components(faces.size, rows, columns)[0] == len(np.unique(faces))


def is_outward(vertices, faces, labels):
    """Is the volume of every part > 0? In integers."""
    corners = exact_integers(vertices[faces])
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    six = (a * (b[:, [1, 2, 0]] * c[:, [2, 0, 1]] - b[:, [2, 0, 1]] * c[:, [1, 2, 0]])).sum(axis=1)
    sums = [0] * (int(labels.max()) + 1)
    for part, volume in zip(labels.tolist(), six.tolist(), strict=True):
        sums[part] += volume
    return min(sums) > 0


def n_duplicates(faces, facet_ids):
    """Facets with the corners of an earlier one of their kind: a triangle, or several."""
    facets = {}
    for facet, face in zip(facet_ids.tolist(), faces.tolist(), strict=True):
        facets.setdefault(facet, []).append(face)
    found = [
        (True, *sorted(own[0])) if len(own) == 1 else (False, *sorted({v for face in own for v in face}))
        for own in facets.values()
    ]
    return len(found) - len(set(found))


def boundary_chains(tails, heads):
    """Simple loops along half-edges; against one only where none goes on forward."""
    outgoing, incoming = {}, {}
    a, b = tails.tolist(), heads.tolist()
    for edge, (tail, head) in enumerate(zip(a, b, strict=True)):
        outgoing.setdefault(tail, []).append(edge)
        incoming.setdefault(head, []).append(edge)
    used = [False] * len(a)
    loops = []

    def step(vertex):
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
                loops.append(path[at:])
                for gone in path[at + 1 :]:
                    del place[gone]
                del path[at + 1 :]
            else:
                place[vertex] = len(path)
                path.append(vertex)
        if len(path) > 1:
            loops.append(path)
    return loops


def facts_of(mesh):
    """The facts by name, but those that nothing new computes."""
    vertices, faces, facet_ids = mesh.vertices, mesh.faces, mesh.facet_ids
    used = np.unique(faces)
    zero = is_degenerate(vertices, faces)
    proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    solid = faces[proper]
    order, first, count, forward = sorted_edges(solid, len(vertices))
    border = order[first[count == 1]]
    tails, heads = solid.reshape(-1)[border], solid[:, [1, 2, 0]].reshape(-1)[border]
    joined = np.concatenate([faces[:, [0, 1]], faces[:, [0, 2]]])
    areas = triangle_areas(vertices, faces)
    found = {
        "is_closed": bool((count == 2).all()),
        "n_boundary_edges": len(border),
        "boundary_loops": boundary_chains(tails, heads),
        "n_nonmanifold_edges": int((count > 2).sum()),
        "is_oriented": bool((np.abs(2 * forward - count) <= count % 2).all()),
        "is_outward": None,
        "degenerate_facets": [f for f in np.unique(facet_ids).tolist() if zero[facet_ids == f].all()]
        if zero.any()
        else [],
        "n_components": components(len(vertices), *joined.T)[0] - len(vertices) + len(used),
        "euler_characteristic": len(np.unique(solid)) - len(first) + len(solid),
        "genus": None,
        "area": float(areas.sum()),
        "volume": float("nan"),
        "area_centroid": areas @ vertices[faces].mean(axis=1) / areas.sum(),
        "bbox": np.stack([vertices[used].min(axis=0), vertices[used].max(axis=0)]),
        "n_facets": len(np.unique(facet_ids)),
        "n_unreferenced_vertices": len(vertices) - len(used),
        "n_duplicate_facets": n_duplicates(faces, facet_ids),
    }
    if found["is_closed"] and found["is_oriented"]:
        labels = components(len(solid), order[first] // 3, order[first + 1] // 3)[1]
        found["volume"] = float(triple_products(*np.moveaxis(vertices[solid], 1, 0)).sum()) / 6.0
        found["is_outward"] = is_outward(vertices, solid, labels)
        if found["n_components"] == 1 and has_one_fan(order, first, solid):
            found["genus"] = (2 - found["euler_characteristic"]) // 2
    return found
