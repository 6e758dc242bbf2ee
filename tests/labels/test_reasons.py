"""Why objects fall short: every cause is named, the main one first, and none contradicts the numbers."""

import re

import label_shapes
import numpy as np
import pytest

from voxkernel import label_stars
from voxkernel.labels.reasons import Hidden, causes_in, reason_of

RAYS = (32, 64, 96, 128)
FINE, FEW = (0.7, 0.85, 0.9, 0.95), (0.1, 0.2, 0.3, 0.4)
LONG = 3.0


def told(image, **options):
    stars = label_stars(image, spacing=(1.0,) * image.ndim, **options)
    return stars.reason[0], stars.detail[0].split("; ")


def rod():
    image = np.zeros((12, 9, 84), np.uint8)
    image[2:11, :, :80] = 1
    return image


def hidden(voxels=1000, *, fragments=1, apart=0, holes=0, behind=0, bent=0):
    return Hidden(voxels, fragments, apart, holes, 5 * holes, behind, bent)


def test_few_hidden_voxels_do_not_hide_that_rays_fall_short():
    hooked = rod()
    hooked[1, 4, 40] = hooked[0, 4, 39:42] = 1  # a T: no voxel sees both of its ends
    stars = label_stars(hooked, spacing=(1, 1, 1))
    assert 0.999 < stars.visible[0] < 1
    assert stars.rays_for_80[0] == 0
    assert stars.reason == ("elongated",)
    assert re.fullmatch(r"too elongated for 96 rays: they reach an overlap of 0\.\d{3}; hidden part of 0\.0\d%",
                        stars.detail[0])  # fmt: skip


def test_a_speck_does_not_hide_that_rays_fall_short():
    speck = rod()
    speck[6, 4, 83] = 1
    reason, words = told(speck)
    assert reason == "elongated"
    assert words[0].startswith("too elongated for 96 rays")
    assert words[1:] == ["2 fragments, 0.02% outside the largest"]


@pytest.mark.parametrize("axes", [2, 3])
def test_all_causes_are_named(axes):
    """A U with a hole in one of its arms, and a piece beside it."""
    image = np.zeros((30, 40), np.uint8)
    image[:, :8] = image[:8, :30] = image[:, 22:30] = 1
    image[10:13, 34:37] = 1
    hole = (slice(20, 23), slice(2, 5))
    if axes == 3:
        image, hole = image[None].repeat(9, 0), (slice(3, 6), *hole)
    names = {"# fragments, # outside the largest", "hidden part of #", "# hole of # voxels, # hidden behind"}
    for value in (0, 1):
        image[hole] = value
        reason, words = told(image)
        assert reason == "hidden part"
        kinds = [re.sub(r"[\d.]+%?", "#", part) for part in words]
        assert kinds[0] == "hidden part of #"
        expected = {name for name in names if value == 0 or "hole" not in name}
        assert {kind for kind in kinds if "elongated" not in kind} == expected


def test_the_shares_of_the_causes_are_what_is_hidden(rng):
    """Of flat images of noise: each hidden voxel is counted once, by the words and by V."""
    n_holes = 0
    for _ in range(40):
        image = label_shapes.blobs(rng, (9, 10), 0.7)
        if not image.any():
            continue
        stars = label_stars(image, spacing=(1, 1))
        lost = [part for part in stars.detail[0].split("; ") if "%" in part]
        total = sum(float(re.search(r"([\d.]+)%", part)[1]) for part in lost)
        assert total == pytest.approx(100 * (1 - stars.visible[0]), abs=0.02)
        assert ("hole" in stars.detail[0]) == (stars.holes[0] > 0)
        assert ("fragment" in stars.detail[0]) == (stars.fragments[0] > 1)
        n_holes += int(stars.holes[0] > 0)
    assert n_holes > 5


def test_what_a_hole_hides_is_told_apart():
    """Nearly all that is hidden in a ball with a hole is seen when it is filled; nothing of a C is."""
    ball = label_shapes.ball(21)
    ball[9:12, 9:12, 9:12] = 0
    reason, words = told(ball)
    assert reason == "hole"
    shares = {part.split()[0]: float(re.search(r"([\d.]+)%", part)[1]) for part in words if "%" in part}
    assert shares["1"] > 10 * shares.get("hidden", 0.0)
    bent = np.ones((9, 20, 20), np.uint8)
    bent[:, 6:14, 6:] = 0
    bent[4, 3, 19] = 0  # at the side: open, no hole
    assert told(bent)[0] == "hidden part"
    assert not any("hole" in part for part in told(bent)[1])


def test_a_fragment_in_a_hole_stays_a_fragment():
    image = label_shapes.ball(21)
    image[4:17, 4:17, 4:17] -= label_shapes.ball(13)
    image[9:12, 9:12, 9:12] = 1
    _, words = told(image)
    assert any(part.startswith("2 fragments, ") for part in words)
    assert any(part.startswith("1 hole of ") for part in words)


@pytest.mark.parametrize(
    ("iou", "reason"),
    [
        ((0.647, 0.803, 0.779, 0.75), ""),  # the overlap need not grow: 64 rays do
        ((0.7, 0.799, 0.79, 0.9), "elongated"),  # 128 do, which is more than usual
        (FEW, "elongated"),
        ((0.85, 0.7, 0.7, 0.7), ""),
    ],
)
def test_elongated_is_what_rays_for_80_says(iou, reason):
    assert reason_of(hidden(), LONG, RAYS, iou)[0] == reason


def test_elongated_never_contradicts_the_numbers_of_rays(rng):
    from voxkernel.labels.reasons import rays_needed

    for _ in range(2000):
        lost = hidden(bent=int(rng.integers(0, 500) * rng.integers(0, 2)))
        iou = tuple((1 - lost.total / 1000) * rng.random(len(RAYS)) ** 0.3)
        needed = rays_needed(RAYS, iou)[0]
        is_few = "elongated" in reason_of(lost, LONG, RAYS, iou)[1]
        assert not (is_few and 0 < needed <= 96)
        if not lost.total:
            assert is_few == (not 0 < needed <= 96)


def test_the_main_cause():
    for lost, iou, reason in (
        (hidden(bent=20, holes=1, behind=10), FINE, "hidden part"),
        (hidden(bent=10, holes=1, behind=20), FINE, "hole"),
        (hidden(bent=10, holes=1, behind=10, fragments=2, apart=10), FINE, "fragment"),
        (hidden(holes=1, behind=10, bent=10), FINE, "hole"),
        (hidden(bent=150), FEW, "elongated"),  # 0.85 is seen, 0.3 reached
        (hidden(bent=250), FEW, "hidden part"),  # 0.75 is seen: no rays would do
        (hidden(bent=150), (0.6, 0.6, 0.75, 0.75), "hidden part"),
        (hidden(bent=1), (0.6, 0.6, 0.7995, 0.7995), "elongated"),  # 0.8 of what is seen, and yet not enough
    ):
        found, words = reason_of(lost, LONG, RAYS, iou)
        assert causes_in(words)[0] == found
        assert found == reason
        first = words.split("; ")[0]
        assert reason in first.replace("holes", "hole").replace("fragments", "fragment")


def test_a_round_object_is_not_elongated_because_of_its_hole():
    reason, detail = reason_of(hidden(holes=1, behind=4), 1.0, RAYS, FEW)
    assert reason == "hole"
    assert detail.endswith("; 96 rays are too few from the best voxel: they reach an overlap of 0.300")
    assert causes_in(detail) == ["hole", "few rays"]
    assert reason_of(hidden(holes=1, behind=4), LONG, RAYS, FEW)[0] == "elongated"
    assert reason_of(hidden(), 1.0, RAYS, FEW)[0] == "elongated"  # the only cause


def test_judged_by_the_most_rays_where_96_are_not_tried():
    assert reason_of(hidden(), LONG, (32, 64, 128), (0.1, 0.2, 0.9)) == ("", "")
    assert reason_of(hidden(), LONG, (32, 64), (0.1, 0.7))[1].startswith("too elongated for 64 rays")


def test_shares_are_not_rounded_to_nothing_or_all():
    assert reason_of(hidden(10**6, bent=3), LONG, RAYS, FINE)[1] == "hidden part of less than 0.01%"
    assert reason_of(hidden(10**6, fragments=10**6, apart=10**6 - 1), LONG, RAYS, FINE)[1].endswith(
        "more than 99.99% outside the largest"
    )
    assert reason_of(hidden(), LONG, RAYS, (0.79999,) * 4)[1].endswith("an overlap of 0.799")
