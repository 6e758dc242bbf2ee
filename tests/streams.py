"""What must be the same of a kernel in chunks and of that in memory."""

import numpy as np

ARRAYS = ("vertices", "face_starts", "face_vertices", "face_facets", "centroid", "inertia", "deepest_point")
NUMBERS = (
    "dimension", "volume", "area", "cut_by_domain", "is_bounded", "unclipped_dimension", "max_residual",
    "volume_bounds",
)  # fmt: skip


def proof(certificate):
    return certificate.kind, certificate.facet_ids, certificate.multipliers, certificate.points


def assert_same(streamed, whole):
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(streamed, name), getattr(whole, name), err_msg=name)
    assert {n: getattr(streamed, n) for n in NUMBERS} == {n: getattr(whole, n) for n in NUMBERS}
    np.testing.assert_equal(streamed.clearance, whole.clearance)
    assert streamed.exact_vertices() == whole.exact_vertices()
    assert proof(streamed.unclipped_certificate) == proof(whole.unclipped_certificate)
    assert streamed.certificate.verify()
    assert streamed.unclipped_certificate.verify()
    assert proof(streamed.certificate) == proof(whole.certificate)
    np.testing.assert_equal(streamed.unclipped_point, whole.unclipped_point)
    assert (streamed.domain is None) == (whole.domain is None)
    if streamed.domain is not None:
        np.testing.assert_array_equal(streamed.domain.normals, whole.domain.normals)
        np.testing.assert_array_equal(streamed.domain.offsets, whole.domain.offsets)
