"""Pictures of label objects: four panels, the best voxel marked in each, words where a surface would be empty."""

import io

import label_shapes
import numpy as np
import pytest

from voxkernel import LabelImage, label_stars

YELLOW = (250, 200, 20)


def panels(array):
    """The four panels of the picture of the only object."""
    pytest.importorskip("pyvista")
    pil = pytest.importorskip("PIL.Image")
    from voxkernel.pictures.label_picture import label_picture

    image = LabelImage.from_array(array, spacing=(1.0,) * array.ndim)
    picture = np.asarray(pil.open(io.BytesIO(label_picture(image, label_stars(image), 0))))
    assert picture.shape == (360, 480, 3)
    return picture[:180, :240], picture[:180, 240:], picture[180:, :240], picture[180:, 240:]


def marks(panel):
    return np.argwhere((panel == YELLOW).all(axis=2))


def test_the_best_voxel_is_marked_in_every_panel():
    """Of a T and of a ball."""
    image = np.zeros((21, 21, 21), np.uint8)
    image[:, 9:12, 9:12] = image[:3, :, 9:12] = 1
    for panel in panels(np.pad(image, 1)):
        assert 20 < len(marks(panel)) < 60
    for panel in panels(label_shapes.ball(13)):
        low, high = marks(panel).min(axis=0), marks(panel).max(axis=0)
        assert (high - low < 12).all()
        assert np.abs((low + high) / 2 - (89.5, 119.5)).max() < 12  # it is the middle


@pytest.mark.parametrize("shape", [(1, 1, 30), (2, 2, 30), (1, 1, 2)])
def test_words_stand_where_a_surface_would_be_empty(shape):
    array = np.zeros((6, 6, 34), np.uint8)
    array[tuple(slice(2, 2 + n) for n in shape)] = 1
    *views, surface = panels(array)
    assert all(len(marks(view)) for view in views)
    ink = np.argwhere((surface < 160).all(axis=2))
    assert len(ink) > 100
    assert np.ptp(ink[:, 1]) > 60  # a line of words
    assert not len(marks(surface))


def test_flat_objects_have_one_panel():
    first, *others = panels(label_shapes.ball(13)[6])
    assert len(marks(first)) > 20
    assert all((panel == 255).all() for panel in others)
