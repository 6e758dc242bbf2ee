"""What must be the same of a kernel in chunks and of that in memory; a large surface, written a piece at a time."""

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


def write_ball(path, n_rings, n_sectors, bump, *, bend=0.0, chunk=64):
    """A ball of radius 1 + bump cos 8a cos 8b, with a spike at each pole, bent by `bend` z^2.

    About 2 n_rings n_sectors facets, made a few rings at a time.
    """
    inner = n_rings - 1
    n_vertices, n_faces = 2 + inner * n_sectors, 2 * n_sectors * inner
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {n_vertices}\nproperty double x\nproperty double y\n"
        f"property double z\nelement face {n_faces}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    b = 2 * np.pi * np.arange(n_sectors) / n_sectors
    around = np.arange(n_sectors), (np.arange(n_sectors) + 1) % n_sectors
    row = np.dtype([("n", "u1"), ("v", "<i4", (3,))])
    with open(path, "wb") as file:
        file.write(head.encode())
        tip = 1 + bump  # beyond the ball, so that the kernel is small
        np.array([[bend * tip**2, 0, tip], [bend * tip**2, 0, -tip]], np.float64).tofile(file)
        for first in range(1, n_rings, chunk):
            a = np.pi * np.arange(first, min(n_rings, first + chunk))[:, None] / n_rings
            r = 1 + bump * np.sin(a) * np.cos(8 * a) * np.cos(8 * b)
            x, y, z = r * np.sin(a) * np.cos(b), r * np.sin(a) * np.sin(b), r * np.cos(a)
            np.stack([x + bend * z**2, y, z], -1).tofile(file)
        for ring in range(n_rings):
            upper, lower = (2 + (ring + k - 1) * n_sectors + np.array(around) for k in range(2))
            if ring == 0:
                faces = np.stack([0 * lower[0], *lower], 1)
            elif ring == inner:
                faces = np.stack([0 * upper[0] + 1, upper[1], upper[0]], 1)
            else:
                faces = np.concatenate([
                    np.stack([upper[0], lower[0], lower[1]], 1), np.stack([upper[0], lower[1], upper[1]], 1)
                ])  # fmt: skip
            rows = np.empty(len(faces), row)
            rows["n"], rows["v"] = 3, faces
            rows.tofile(file)
    return n_faces
