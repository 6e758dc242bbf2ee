"""Files that are mapped: how much of them a process holds, and that they are read in an order that suits them."""

import subprocess
import sys

import label_shapes
import numpy as np
import pytest

from voxkernel import LabelImage, find_objects, label_stars, read_labels
from voxkernel.labels import label_image
from voxkernel.labels.label_image import block_boxes, slow_axis
from voxkernel.labels.objects import crop_of

# How much more a process holds at most than after it has done the same with a small file, in MB.
GROWN = """
import sys, voxkernel
def most():
    return int(next(l for l in open("/proc/self/status") if l.startswith("VmHWM")).split()[1]) / 1000
def row(path):
    before = most()
    stars = voxkernel.label_stars(path, spacing=(1, 1, 1), n_rays=(8,))
    return len(stars), most() - before
row(sys.argv[1])
print(*row(sys.argv[2]))
"""


def scattered(shape, n):
    """`n` balls along the diagonal, so that together they touch every part of the file."""
    image, ball = np.zeros(shape, np.uint16), label_shapes.ball(9)
    for k in range(n):
        low = [k * (size - 9) // (n - 1) for size in shape]
        image[tuple(slice(a, a + 9) for a in low)] += (ball * (k + 1)).astype(np.uint16)
    return image


def written(folder, suffix, image):
    path = folder / f"{image.shape[0]}{suffix}"
    if suffix == ".npy":
        np.save(path, image)
    elif suffix == ".tif":
        pytest.importorskip("tifffile").imwrite(path, image)
    else:
        nibabel = pytest.importorskip("nibabel")
        nibabel.save(nibabel.Nifti1Image(image, np.eye(4)), path)
    return path


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("suffix", [".npy", ".tif", ".nii"])
def test_little_of_a_mapped_file_is_held(tmp_path, suffix):
    """A file of 262 MB that is scanned and of which objects everywhere are cut out."""
    paths = [written(tmp_path, suffix, scattered(shape, n)) for shape, n in (((30, 64, 64), 2), ((320, 640, 640), 60))]
    done = subprocess.run([sys.executable, "-c", GROWN, *map(str, paths)], capture_output=True, text=True, check=True)
    n, grown = done.stdout.split()
    assert int(n) == 60
    assert float(grown) < 110.0


@pytest.mark.parametrize("shape", [(23, 9, 11), (17, 30)])
def test_files_whose_first_axis_is_fastest(tmp_path, monkeypatch, rng, shape):
    image = (rng.random(shape) < 0.7).astype(np.uint16) * 7
    image[3, 4] = 9
    np.save(tmp_path / "image.npy", np.asfortranarray(image))
    mapped = LabelImage.from_array(np.load(tmp_path / "image.npy", mmap_mode="r"), spacing=(1.0,) * len(shape))
    plain = LabelImage.from_array(image, spacing=mapped.spacing)
    assert (slow_axis(mapped), slow_axis(plain)) == (len(shape) - 1, 0)
    expected = [crop_of(plain, find_objects(plain), i) for i in range(2)]
    monkeypatch.setattr(label_image, "_BLOCK_BYTES", 256)
    boxes = block_boxes(mapped)
    assert len(boxes) > 1
    assert all(b[0] - a[0] == shape[0] for a, b in boxes)
    objects = find_objects(mapped)
    assert objects.low.tolist() == find_objects(plain).low.tolist()
    for i, crop in enumerate(expected):
        assert np.array_equal(crop_of(mapped, objects, i), crop)


def test_what_was_written_into_a_copy_of_pages_stays(tmp_path):
    image = scattered((60, 640, 640), 5)
    np.save(tmp_path / "image.npy", image)
    mapped = np.load(tmp_path / "image.npy", mmap_mode="c")
    mapped[40, 40, 40] = 9
    stars = label_stars(mapped, spacing=(1, 1, 1), n_rays=(8,))
    assert stars.label.tolist() == [1, 2, 3, 4, 5, 9]
    assert mapped[40, 40, 40] == 9
    assert label_stars(tmp_path / "image.npy", spacing=(1, 1, 1), n_rays=(8,)).label.tolist() == [1, 2, 3, 4, 5]


def test_a_nifti_file_is_mapped_for_reading(tmp_path):
    path = written(tmp_path, ".nii", scattered((30, 64, 64), 2))
    source = read_labels(path).source
    assert isinstance(source, np.memmap)
    assert source.mode == "r"
