"""Edges of triangles, against a dictionary of their ends."""

import numpy as np
import pytest
import shapes

from voxkernel.mesh.edges import half_edges

SURFACES = {
    "closed": shapes.icosphere(1),
    "open": shapes.open_box(),
    "three at an edge": shapes.three_faces_on_an_edge(),
    "not oriented": shapes.cube_with_flipped_face(),
}


@pytest.mark.parametrize(("vertices", "faces"), SURFACES.values(), ids=list(SURFACES))
def test_edges(vertices, faces):
    found = {}
    for half_edge, (tail, head) in enumerate(zip(faces.ravel(), faces[:, [1, 2, 0]].ravel(), strict=True)):
        found.setdefault((min(tail, head), max(tail, head)), []).append(half_edge)
    edges = half_edges(faces, len(vertices))
    assert list(map(tuple, edges.ends(faces).tolist())) == sorted(found)
    assert np.column_stack(edges.pairs()).tolist() == [h for _, h in sorted(found.items()) if len(h) == 2]
    assert [np.flatnonzero(edges.numbers() == e).tolist() for e in range(len(found))] == [
        h for _, h in sorted(found.items())
    ]
