"""Copies of few facets: as many as may be, whatever noise makes of the area."""

import pytest
import shapes

from voxkernel.mesh.triangles import triangle_areas
from voxkernel.registration.thin import thinned


@pytest.mark.parametrize("noise", [0.0, 0.3, 2.0, 8.0])
def test_noise_makes_no_copy_coarser(rng, noise):
    """Noise in units of the edges: at 8 the area is some fifty times that of the surface without it."""
    vertices, faces = shapes.height_field(n=200)
    vertices = vertices + rng.normal(size=vertices.shape) * noise / 200
    area = triangle_areas(vertices, faces).sum()
    thin, triangles = thinned(vertices, faces, area, most=8000)
    assert 4000 <= len(triangles) <= 8000
    assert len(thin) < len(vertices)


def test_few_facets_stay_as_they_are(rng):
    vertices, faces = shapes.height_field(n=8)
    assert thinned(vertices, faces, 1.0, most=len(faces))[0] is vertices
