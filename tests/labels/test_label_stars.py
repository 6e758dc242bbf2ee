"""`label_stars`: known answers, laws, and what it says of images it cannot use."""

import label_shapes
import numpy as np
import pytest

import voxkernel
from voxkernel import LabelImage, find_objects, label_stars

ONE = (1.0, 1.0, 1.0)


def only(image, **options):
    stars = label_stars(image, spacing=options.pop("spacing", (1.0,) * image.ndim), **options)
    assert len(stars) == 1
    return stars


@pytest.mark.parametrize("n", [3, 9, 21, 33])
def test_a_ball_is_seen_from_its_middle(n):
    stars = only(label_shapes.ball(n))
    assert stars.visible[0] == stars.visible_upper[0] == stars.visible_deepest[0] == 1.0
    assert stars.center.tolist() == [[n // 2] * 3]
    assert stars.elongation[0] == pytest.approx(1.0, abs=1e-12)
    assert (stars.fragments[0], stars.holes[0]) == (1, 0)
    if n >= 9:
        assert stars.reason == ("",)
        assert stars.iou[0, -1] > 0.93


def test_octagonal_shapes_are_seen_from_everywhere(rng):
    from voxkernel._core import visible_count

    for axes in (2, 3):
        for _ in range(5):
            image = label_shapes.octagonal(rng, 8, axes)
            crop = np.pad(image if axes == 3 else image[None], 1)
            n = int(crop.sum())
            assert n > 1
            assert {visible_count(crop, axes == 2, v) for v in np.ascontiguousarray(np.argwhere(crop))} == {n}


def test_known_reasons():
    two = np.zeros((5, 5, 12), np.uint8)
    two[1:4, 1:4, 1:4] = two[1:4, 1:4, 7:11] = 1
    parts = only(two)
    assert parts.reason == ("fragment",)
    assert parts.visible[0] == 36 / 63
    assert parts.detail == ("2 fragments, 42.86% outside the largest",)
    hollow = only(label_shapes.shell())
    assert hollow.reason == ("hole",)
    assert (hollow.holes[0], hollow.hole_voxels[0]) == (1, int(label_shapes.ball(5).sum()))
    bent = only(label_shapes.c_shape())
    assert bent.reason == ("hidden part",)
    assert 0.5 < bent.visible[0] < 1
    bar = only(np.ones((3, 3, 60), np.uint8))
    assert bar.reason == ("elongated",)
    assert bar.visible[0] == 1.0
    assert bar.elongation[0] == pytest.approx(20.0)
    assert bar.detail[0].startswith("too elongated for 96 rays: they reach an overlap of 0.")


def test_a_corner_joins():
    image = np.zeros((2, 2, 2), np.uint8)
    image[0, 0, 0] = image[1, 1, 1] = 1
    assert only(image).visible[0] == 1.0
    assert only(image).fragments[0] == 1


def test_a_single_voxel():
    for axes in (2, 3):
        image = np.zeros((4,) * axes, np.uint8)
        image[(2,) * axes] = 9
        stars = only(image)
        assert (stars.voxels[0], stars.visible[0], stars.elongation[0]) == (1, 1.0, pytest.approx(1.0))
        assert stars.center.tolist() == [[2] * axes]
        assert (stars.iou == 1.0).all()


def laws(image, spacing):
    stars = label_stars(image, spacing=spacing, n_rays=(32,))
    return stars.voxels.tolist(), stars.visible.tolist(), stars.fragments.tolist(), stars.holes.tolist(), stars.label


@pytest.mark.parametrize("axes", [2, 3])
def test_flips_permutations_and_moves(rng, axes):
    shape = (14, 11) if axes == 2 else (8, 9, 7)
    spacing = (2.0, 1.0) if axes == 2 else (2.0, 1.0, 0.5)
    image = label_shapes.blobs(rng, shape, 0.6) * rng.integers(1, 3, shape).astype(np.uint8)
    expected = laws(image, spacing)
    order = tuple(rng.permutation(axes))
    for other, steps in (
        (np.flip(image, rng.integers(axes)), spacing),
        (image.transpose(order), tuple(spacing[k] for k in order)),
        (np.pad(image, ((2, 1),) * axes), spacing),
        (image, (1.0,) * axes),  # V does not depend on the spacing
    ):
        for one, two in zip(expected, laws(other, steps), strict=True):
            assert np.array_equal(one, two)


def test_arrays_of_every_kind(rng):
    base = (label_shapes.blobs(rng, (6, 7, 8), 0.5) * rng.integers(1, 4, (6, 7, 8))).astype(np.uint16)
    expected = laws(base, ONE)
    wide = np.zeros((12, 7, 16), np.uint16)
    wide[::2, :, ::2] = base
    kinds = [base.astype(t) for t in ("u1", ">u2", "<u4", "u8", "i1", ">i4", "i8", "f4", ">f8", "f2")]
    kinds += [wide[::2, :, ::2], base[::-1][::-1], np.asfortranarray(base), base.tolist()]
    for image in kinds:
        for one, two in zip(expected, laws(image, ONE), strict=True):
            assert np.array_equal(one, two)
    flipped = base[::-1, :, ::-1]
    assert laws(flipped, ONE)[:4] == laws(flipped.copy(), ONE)[:4]
    large = np.where(base == 2, 2**40, base.astype(np.int64))
    assert label_stars(large, spacing=ONE).label.tolist() == [1, 3, 2**40]
    assert label_stars(base > 0, spacing=ONE).label.tolist() == [1]


def test_nothing_is_an_empty_table():
    for shape in ((3, 4), (3, 4, 5)):
        stars = label_stars(np.zeros(shape, np.uint8), spacing=(1,) * len(shape))
        assert len(stars) == 0
        assert stars.iou.shape == (0, 5)
        assert stars.center.shape == (0, len(shape))
        assert stars.to_arrow().num_rows == 0


def test_tables_can_be_put_together():
    """Types do not depend on what the rows hold: with and without surfaces, without objects, of other axes."""
    pa = pytest.importorskip("pyarrow")
    ball = label_shapes.ball(9)
    tables = [
        label_stars(image, spacing=(1, 1, 1), n_rays=(32,), surface=surface).to_arrow()
        for image, surface in ((ball, False), (ball, True), (0 * ball, False))
    ]
    assert pa.concat_tables(tables).column("label").to_pylist() == [1, 1]
    assert not any(pa.types.is_null(field.type) for field in tables[2].schema)
    assert tables[0].column("kernel_ratio").null_count == 1
    other = label_stars(ball[4], spacing=(1, 1), n_rays=(64,)).to_arrow()
    for pair in ((tables[0], other), (other, tables[2])):
        assert pa.concat_tables(pair, promote_options="default").num_rows == sum(t.num_rows for t in pair)
    assert tables[1].to_pydict() == label_stars(ball, spacing=(1, 1, 1), n_rays=(32,), surface=True).to_dict()


def test_threads_and_ids_do_not_change_rows(rng):
    image = np.zeros((30, 30, 30), np.uint16)
    for k, place in enumerate(np.ndindex(5, 5, 5), 1):
        low = np.array(place) * 6
        image[tuple(slice(a, a + 5) for a in low)] = k * label_shapes.blobs(rng, (5, 5, 5), 0.7)
    one, two = (label_stars(image, spacing=(1, 1, 1), threads=t) for t in (1, 2))
    assert one.to_dict() == two.to_dict()
    few = label_stars(image, spacing=(1, 1, 1), ids=[90, 7, 7])
    assert few.label.tolist() == [7, 90]
    rows = {label: row for label, *row in zip(*one.to_dict().values(), strict=True)}
    assert all(rows[label] == row for label, *row in zip(*few.to_dict().values(), strict=True))


@pytest.mark.parametrize("unit", [1e-60, 1e-9, 1e9, 1e59])
def test_units_do_not_change_answers(unit):
    image = label_shapes.c_shape(9, 2)
    stars, expected = (label_stars(image, spacing=(2 * u, u, u), n_rays=(32,)) for u in (unit, 1.0))
    one, two = stars.to_dict(), expected.to_dict()
    for name in one:
        if not name.startswith("center_world"):
            assert one[name] == (pytest.approx(two[name]) if name == "elongation" else two[name])


def test_borders():
    image = np.zeros((4, 5, 6), np.uint8)
    image[1:3, 1:3, 1:3] = 1
    image[3, 2, 2] = 2
    assert label_stars(image, spacing=ONE).touches_border.tolist() == [False, True]
    # An image of two axes has no border above and below.
    assert label_stars(image[1], spacing=(1, 1)).touches_border.tolist() == [False]


def test_a_spacing_makes_rays_even_in_the_world():
    """A ball in the world, in flat voxels, is as well described as one in cubes."""
    p = np.indices((13, 39, 39)).astype(float)
    image = (((p[0] - 6) * 3) ** 2 + (p[1] - 19) ** 2 + (p[2] - 19) ** 2 <= 18.5**2).astype(np.uint8)
    right = only(image, spacing=(3, 1, 1))
    assert right.elongation[0] == pytest.approx(1.0, abs=0.05)
    assert right.iou[0, -1] > 0.9
    assert only(image).elongation[0] > 2.5
    assert right.center_world.tolist() == [[18.0, 19.0, 19.0]]


def test_surfaces():
    p = np.indices((22, 22, 22)) - 10.5
    ellipsoid = ((p[0] / 9) ** 2 + (p[1] / 8) ** 2 + (p[2] / 7) ** 2 <= 1).astype(np.uint8)
    stars = only(ellipsoid, surface=True)
    assert stars.verdict == ("star-shaped",)
    assert stars.defect_upper[0] == 0.0
    assert stars.kernel_ratio[0] > 0.9
    bent = only(label_shapes.c_shape(24, 6).repeat(2, 0), surface=True)
    assert bent.verdict == ("not star-shaped",)
    assert 0 < bent.defect_lower[0] <= bent.defect_upper[0]
    assert np.isnan(only(ellipsoid).kernel_ratio[0])


def objects_of(image):
    return find_objects(LabelImage.from_array(image, spacing=(1, 1)))


WRONG = {
    "must have 2 or 3 axes; got 4": (np.ones((2, 2, 2, 2), int), {"spacing": (1, 1, 1, 1)}),
    "must have 2 or 3 axes; got 1": (np.ones(3, int), {"spacing": (1,)}),
    r"must be >= 0, with 0 for the background; got -1": (np.full((2, 2), -1), {"spacing": (1, 1)}),
    "must be >= 0, with 0 for the background; got -2": (np.full((2, 2), -2.0), {"spacing": (1, 1)}),
    "must be integers; got 0.5": (np.full((2, 2), 0.5), {"spacing": (1, 1)}),
    "must be integers; got nan": (np.full((2, 2), np.nan), {"spacing": (1, 1)}),
    "must be at most 2..53": (np.full((2, 2), 1e17), {"spacing": (1, 1)}),
    r"must be at most 2\*\*63 - 1; got 18446744073709551615": (
        np.full((2, 2), 2**64 - 1, np.uint64), {"spacing": (1, 1)},
    ),
    "must have voxels; got shape": (np.ones((0, 2), int), {"spacing": (1, 1)}),
    "must be integers, or floats with integer values; got dtype c": (np.ones((2, 2), complex), {"spacing": (1, 1)}),
    "`spacing` must be given for an array": (np.ones((2, 2), int), {}),
    "`spacing` must have one number for each of 2 axes; got 3": (np.ones((2, 2), int), {"spacing": (1, 1, 1)}),
    "`spacing` must be > 0; got 0": (np.ones((2, 2), int), {"spacing": (1, 0)}),
    "`spacing` must not differ by more than": (np.ones((2, 2), int), {"spacing": (1, 1e-7)}),
    "`spacing` must be from 1e-60 to 1e.60; got": (np.ones((2, 2), int), {"spacing": (1e-61, 1e-61)}),
    "`labels` must not be masked": (np.ma.masked_array(np.ones((2, 2), int)), {"spacing": (1, 1)}),
    "`objects` must be LabelObjects, from `find_objects`; got int": (
        np.ones((2, 2), int), {"spacing": (1, 1), "objects": 3},
    ),
    "`objects` must be of this image; got 4 voxels of label 2, which has 0": (
        np.ones((2, 2), int), {"spacing": (1, 1), "objects": objects_of([[2, 2]] * 2)},
    ),
    "`objects` must be of this image; got boxes outside its shape": (
        np.ones((2, 2), int), {"spacing": (1, 1), "objects": objects_of([[1] * 3])},
    ),
    "`spacing` must be a sequence of numbers": (np.ones((2, 2), int), {"spacing": 1.0}),
    "`spacing` must be finite as a double; got a larger int": (np.ones((2, 2), int), {"spacing": (10**400, 1)}),
    "`surface` must be True or False; got str": (np.ones((2, 2), int), {"spacing": (1, 1), "surface": "no"}),
    "`surface` must be True or False; got ndarray": (
        np.ones((2, 2), int), {"spacing": (1, 1), "surface": np.array([True, False])},
    ),
    "`n_rays` must be in 3..4096; got 2": (np.ones((2, 2), int), {"spacing": (1, 1), "n_rays": (2,)}),
    "`n_rays` must be in 4..4096; got 3": (np.ones((2, 2, 2), int), {"spacing": (1, 1, 1), "n_rays": (3,)}),
    "`n_rays` must hold at least one": (np.ones((2, 2), int), {"spacing": (1, 1), "n_rays": ()}),
    "`n_rays` must be a sequence of integers": (np.ones((2, 2), int), {"spacing": (1, 1), "n_rays": 32}),
    "`ids` must be labels of the image; got 5": (np.ones((2, 2), int), {"spacing": (1, 1), "ids": [1, 5]}),
    "`threads` must be in 1..256; got 0": (np.ones((2, 2), int), {"spacing": (1, 1), "threads": 0}),
    "must be an array; got rows of different": ([[1], [1, 2]], {"spacing": (1, 1)}),
}  # fmt: skip


@pytest.mark.parametrize("words", WRONG)
def test_errors(words):
    image, options = WRONG[words]
    with pytest.raises((ValueError, TypeError), match=words) as caught:
        label_stars(image, **options)
    assert "\n" not in str(caught.value)


def test_boxes_of_an_image_in_chunks(rng):
    """Objects that cross chunks, read by something that only gives slices."""
    image = (rng.integers(0, 40, (20, 21, 22)) * (rng.random((20, 21, 22)) < 0.5)).astype(np.int32)

    class Slices:
        shape, dtype, chunks = image.shape, image.dtype, (7, 6, 5)
        largest = 0

        def __getitem__(self, box):
            part = image[box]
            Slices.largest = max(Slices.largest, part.size)
            return part

    lazy, whole = LabelImage.from_array(Slices(), spacing=ONE), LabelImage.from_array(image, spacing=ONE)
    found, expected = find_objects(lazy), find_objects(whole, threads=2)
    for name in ("label", "voxels", "low", "high"):
        assert np.array_equal(getattr(found, name), getattr(expected, name))
    assert Slices.largest <= 7 * 6 * 5
    assert label_stars(lazy, n_rays=(32,)).to_dict() == label_stars(whole, n_rays=(32,)).to_dict()
    assert np.array_equal(lazy.to_array(), image)
    with pytest.raises(ValueError, match="must be a box in an image"):
        lazy.read([0, 0, 0], [1, 1, 99])


@pytest.mark.slow
def test_balls_of_a_million_voxels_and_checkerboards():
    assert only(label_shapes.ball(125)).visible[0] == 1.0
    board = (np.indices((16, 16, 16)).sum(axis=0) % 2).astype(np.uint8)
    stars = only(board)
    assert stars.fragments[0] == 1
    assert stars.is_certified[0]
    assert voxkernel.label_stars(board, spacing=ONE).visible[0] < 0.6
