"""Rays, distances and bodies beside StarDist's own code, on real nuclei and root cells; skipped without it."""

import os
from pathlib import Path

import label_shapes
import numpy as np
import pytest

import voxkernel
from voxkernel._core import StarRaster, ray_lengths
from voxkernel.labels import find_objects
from voxkernel.labels.objects import crop_of
from voxkernel.labels.ray_sets import golden_rays, ray_set

try:
    from stardist import geometry
    from stardist import rays3d as stardist
except ImportError as error:  # also of a package that it needs
    pytest.skip(
        f"StarDist cannot be imported: {error} (pip install --no-deps stardist csbdeep, and what they need: "
        "pip install tqdm scikit-image numba six)",
        allow_module_level=True,
    )
DATA = Path(os.environ.get("VOXKERNEL_DATA", Path(__file__).parents[3] / "shared" / "data")) / "labels"
VOLUMES = {"stardist_mask3d.tif": (2.0, 1.0, 1.0), "ps_1135.h5::label": (0.284, 0.127, 0.127)}


@pytest.mark.parametrize("n", [32, 96])
def test_rays(n):
    theirs = stardist.Rays_GoldenSpiral(n, anisotropy=(2, 1, 1))
    ours = ray_set(n, (2.0, 1.0, 1.0))
    unit = ours.steps / np.linalg.norm(ours.steps, axis=1)[:, None]
    np.testing.assert_allclose(unit, theirs.vertices, atol=1e-6)
    assert np.allclose(golden_rays(n), stardist.Rays_GoldenSpiral(n).vertices, atol=1e-6)
    one, two = ({frozenset(map(int, face)) for face in faces} for faces in (ours.faces, theirs.faces))
    assert len(one ^ two) <= 4  # four directions on a circle may be cut either way


def volume_of(name):
    if not (DATA / name.partition("::")[0]).exists():
        pytest.skip(f"no data at {DATA}")
    pytest.importorskip("h5py" if "h5" in name else "tifffile")
    return voxkernel.read_labels(DATA / name, spacing=VOLUMES[name])


@pytest.mark.parametrize("name", VOLUMES)
def test_distances_and_bodies_on_real_volumes(name):
    image = volume_of(name)
    labels = image.to_array()
    objects = find_objects(image)
    theirs = stardist.Rays_GoldenSpiral(96, anisotropy=image.spacing)
    ours = ray_set(96, image.spacing)
    scale = np.linalg.norm(ours.steps, axis=1)
    differences, of_lengths = [], []
    stars = voxkernel.label_stars(image, n_rays=(96,))
    for i in range(0, len(objects), 5):  # StarDist computes the rays of all voxels
        center = stars.center[i]
        crop, low = crop_of(image, objects, i), objects.low[i]
        lengths = np.empty(96)
        ray_lengths(crop, False, center - low + 1, ours.steps, True, lengths)
        only = (labels == objects.label[i]).astype(np.uint16)
        box = tuple(slice(max(0, a - 3), b + 3) for a, b in zip(low, objects.high[i], strict=True))
        inner = center - np.array([s.start for s in box])
        dist = geometry.star_dist3D(only[box], theirs)[tuple(inner)]
        of_lengths.append(np.abs(lengths * scale - dist).max())
        body = geometry.polyhedron_to_label(dist[None], inner[None], theirs, only[box].shape, verbose=False) != 0
        object_ = only[box] != 0
        overlap = (body & object_).sum() / (body | object_).sum()
        ends = (dist / scale)[:, None] * ours.steps
        size, common = StarRaster(crop, False).count(
            center - low + 1, ends, ours.faces, 1 - low, np.array(image.shape) - low
        )
        differences.append(abs(common / (objects.voxels[i] + size - common) - overlap))
    assert np.median(differences) <= 0.005
    assert max(differences) <= 0.02
    # A sample on the border between two voxels may be rounded either way: their steps are added up in float32.
    assert np.mean(np.array(of_lengths) < 1e-3) > 0.8


def test_distances_of_two_axes():
    image = label_shapes.ball(21, axes=2)
    center = np.array([9, 11])
    dist = geometry.star_dist(image.astype(np.uint16), n_rays=32)[tuple(center)]
    lengths = np.empty(32)
    crop = np.pad(image[None], 1)
    ray_lengths(crop, True, np.array([1, *(center + 1)]), ray_set(32, (1.0, 1.0)).steps, True, lengths)
    assert np.mean(np.abs(lengths - dist) < 1e-4) > 0.9


def test_kernels_of_star_polyhedra_beside_qhull(rng):
    from scipy.spatial import ConvexHull, HalfspaceIntersection

    rays = stardist.Rays_GoldenSpiral(96)
    distances = 10 * (1 + 0.2 * rng.random((20, 96)))
    centers = rng.normal(size=(20, 3))
    kernels = voxkernel.star_polyhedra_kernels(centers, distances, rays.vertices, faces=rays.faces)
    for i in range(20):
        corners = distances[i][:, None] * rays.vertices.astype(np.float64)
        a, b, c = (corners[rays.faces[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        offsets = np.einsum("ij,ij->i", normals, a)
        turned = np.where(offsets < 0, -1.0, 1.0)
        points = HalfspaceIntersection(
            np.column_stack([normals * turned[:, None], -offsets * turned]), np.zeros(3)
        ).intersections
        assert kernels.volume[i] == pytest.approx(ConvexHull(points).volume, rel=1e-7)
        np.testing.assert_allclose(kernels.low[i], points.min(axis=0) + centers[i], atol=1e-6)
        np.testing.assert_allclose(kernels.high[i], points.max(axis=0) + centers[i], atol=1e-6)
