"""Kernels of parts of a surface, so that clutter and what was cut away lose their pull."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel.measures import KernelMoments, kernel_moments
from voxkernel.mesh.triangles import doubled_areas
from voxkernel.registration.prepare import PreparedSurface, kernels_of, simplified

__all__ = ["moments_of_part", "smooth_parts"]

_CREASE = 0.5  # cosine between normals of neighbours that end a smooth part
_LEAST, _MOST = 0.1, 0.9  # shares of the area that make a part worth its own kernels
_MOST_PARTS = 2


def smooth_parts(surface: PreparedSurface) -> list[NDArray[np.bool_]]:
    """Give masks of the facets of the largest parts that neither creases nor gaps cut, largest first."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    faces, normals = surface.skin.faces, surface.skin.normals
    ends = np.sort(np.concatenate([faces[:, [1, 2]], faces[:, [2, 0]], faces[:, [0, 1]]]), axis=1)
    owners = np.tile(np.arange(len(faces)), 3)
    keys = ends[:, 0] * np.int64(len(surface.skin.vertices)) + ends[:, 1]
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    one, two = owners[order[same]], owners[order[same + 1]]
    flat = np.einsum("ij,ij->i", normals[one], normals[two]) > _CREASE
    links = coo_array((np.ones(flat.sum()), (one[flat], two[flat])), shape=(len(faces), len(faces)))
    label = connected_components(links, directed=False)[1]
    areas = np.bincount(label, weights=doubled_areas(surface.skin.vertices[faces]))
    shares = areas / areas.sum()
    wanted = [k for k in np.argsort(-shares, kind="stable")[:_MOST_PARTS] if _LEAST < shares[k] < _MOST]
    return [label == k for k in wanted]


def moments_of_part(surface: PreparedSurface, facets: NDArray[np.bool_]) -> tuple[KernelMoments, ...]:
    """Compute the relaxed kernels of some facets of the smoothed copy; none where they are too few."""
    if facets.sum() < 20:
        return ()
    used, faces = np.unique(surface.skin.faces[facets], return_inverse=True)
    part = simplified(surface.smooth[used], faces.reshape(-1, 3).astype(np.int64), surface.diagonal)
    if not doubled_areas(part[0][part[1]]).sum() > 0:
        return ()
    return tuple(kernel_moments(k) for k in kernels_of(part, surface.margins))
