"""Objects that are large: what is held of them, and that they are measured as small ones are."""

import subprocess
import sys

import label_shapes
import numpy as np
import pytest

from voxkernel import LabelImage, find_objects, label_stars
from voxkernel._core import StarRaster, ray_lengths
from voxkernel.labels import label_image
from voxkernel.labels.objects import crop_of
from voxkernel.labels.ray_sets import ray_set

GROWN = """
import sys, voxkernel
def most():
    return int(next(l for l in open("/proc/self/status") if l.startswith("VmHWM")).split()[1])
def row(path):
    before = most()
    voxkernel.label_stars(path, spacing=(1, 1, 1), most_steps=3_000_000)
    return (most() - before) * 1024
row(sys.argv[1])
print(row(sys.argv[2]))
"""


def notched_ball(n):
    g = np.arange(n) - (n - 1) / 2
    image = np.zeros((n, n, n), np.uint8)
    for i in range(n):
        image[i] = g[:, None] ** 2 + g[None] ** 2 + g[i] ** 2 <= n * n / 4
    image[n // 4 : n // 2, : n // 3, n // 4 : n // 2] = 0
    return image


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("n", [200, pytest.param(400, marks=pytest.mark.slow)])
def test_memory_of_one_large_object_in_a_file(tmp_path, n):
    """At most that of its crop, one byte a voxel, plus 200 MB; far less for a smaller one."""
    for size in (12, n):
        np.save(tmp_path / f"{size}.npy", notched_ball(size))
    files = [str(tmp_path / f"{size}.npy") for size in (12, n)]
    done = subprocess.run([sys.executable, "-c", GROWN, *files], capture_output=True, text=True, check=True)
    assert int(done.stdout) < n**3 + (200e6 if n == 400 else 40e6)


@pytest.mark.parametrize("shape", [(23, 9, 11), (17, 30)])
@pytest.mark.parametrize("mode", ["r", "c"])
def test_crops_that_are_cut_in_layers(tmp_path, monkeypatch, rng, shape, mode):
    """Of a file that is mapped; what was written into a copy of its pages stays."""
    image = (rng.random(shape) < 0.7).astype(np.uint16) * 7
    image[3, 4] = 9
    np.save(tmp_path / "image.npy", image)
    mapped = np.load(tmp_path / "image.npy", mmap_mode=mode)
    if mode == "c":
        mapped[5, 5] = image[5, 5] = 7
    given = LabelImage.from_array(mapped, spacing=(1.0,) * len(shape))
    whole = [crop_of(given, find_objects(given), i) for i in range(2)]
    monkeypatch.setattr(label_image, "_BLOCK_BYTES", 256)
    objects = find_objects(given)
    assert len(label_image.layers_of(given, [1, *[0] * (len(shape) - 1)], list(shape))) > 1
    for i, crop in enumerate(whole):
        low, high = objects.low[i], objects.high[i]
        inside = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        found = crop_of(given, objects, i)
        assert np.array_equal(found, crop)
        inner = found[1:-1, 1:-1, 1:-1].reshape(image[inside].shape)
        assert np.array_equal(inner, image[inside] == objects.label[i])


def test_layers_do_not_cut_chunks(monkeypatch):
    class Chunked:
        shape, dtype, chunks = (40, 8, 8), np.dtype(np.uint8), (6, 8, 8)

        def __getitem__(self, box):
            assert all(s.stop - s.start <= 6 and s.start % 6 == 0 for s in box[:1])
            return np.full([s.stop - s.start for s in box], 3, np.uint8)

    image = LabelImage.from_array(Chunked(), spacing=(1, 1, 1))
    monkeypatch.setattr(label_image, "_BLOCK_BYTES", 900)
    assert label_image.layers_of(image, [4, 0, 0], [33, 8, 8]) == [(4, 12), (12, 24), (24, 33)]
    assert crop_of(image, find_objects(image), 0).sum() == 40 * 64


def test_bodies_of_rays_in_a_large_crop():
    """Counted by bits of rows as in the same crop without background around."""
    small = np.pad(label_shapes.c_shape(40, 9), 1)
    large = np.pad(small, ((0, 60), (3, 50), (70, 80)))
    assert small.size < 2**20 < large.size
    rays = ray_set(96, (1.0, 1.0, 1.0))
    at = np.ascontiguousarray(np.argwhere(small)[small.sum() // 3])
    found = []
    for crop, center in ((small, at), (large, at + np.array([0, 3, 70]))):
        lengths = np.empty(len(rays.steps))
        ray_lengths(crop, False, center, rays.steps, False, lengths)
        ends = (1.5 * lengths + 2)[:, None] * rays.steps
        low = center - at - 1
        found.append(StarRaster(crop, False).count(center, ends, rays.faces, low, low + np.array(small.shape) + 1))
    assert found[0] == found[1]
    assert 0 < found[0][1] < found[0][0]


def test_a_large_object_in_layers_of_a_file(tmp_path):
    """Some 40 MB, so that the file is given back in between."""
    image = np.zeros((90, 700, 640), np.uint8)
    image[5:85, 100:600, 50:600] = 4
    image[5:40, 100:300, 50:90] = 0
    np.save(tmp_path / "large.npy", image)
    arguments = {"spacing": (1, 1, 1), "n_rays": (32,), "most_steps": 0}
    assert label_stars(tmp_path / "large.npy", **arguments).to_dict() == label_stars(image, **arguments).to_dict()
