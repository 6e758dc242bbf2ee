"""`starshapeness` ranks surfaces without a kernel; `defect_profile` is the curve behind it."""

import json
from itertools import pairwise

import numpy as np
import pytest
import shapes

from voxkernel import best_center, defect_profile, exact_kernel, starshapeness


def test_star_shaped():
    score = starshapeness(shapes.l_prism())
    assert score.violation_bounds == (0, 0)
    assert (score.star_center == score.center).all()
    assert score.visible is None
    assert score.profile is None
    assert "violation_bounds" not in repr(score)


def test_not_star_shaped():
    score = starshapeness(shapes.torus())
    assert score.verdict == "not star-shaped"
    assert score.violation_bounds == best_center(shapes.torus()).violation_bounds
    assert (score.star_center == best_center(shapes.torus()).point).all()
    assert score.center is None
    assert "violation_bounds=(0.25" in repr(score)


def test_ranking():
    """Two boxes miss a side of twelve, the torus more, two far tori more again."""
    torus = shapes.torus()
    pair = shapes.joined(torus, (torus[0] + (0, 0, 9), torus[1]))
    bounds = [starshapeness(s).violation_bounds for s in (shapes.cube(), shapes.two_boxes(), torus, pair)]
    for (_, high), (low, _) in pairwise(bounds):
        assert high < low


def test_detail():
    score = starshapeness(shapes.torus(), detail=True)
    assert score.visible.violation <= score.violation_bounds[1] + 1e-12
    assert score.visible.fraction <= 1 - score.violation_bounds[0]
    assert score.profile.tolerances.tolist() == [0.01, 0.03, 0.1]
    assert (score.profile.volume_share_bounds == 0).all()
    document = json.loads(json.dumps(score.to_dict()))
    assert document["visible"]["n_samples"] == 100_000
    assert len(document["profile"]["volume_share_bounds"]) == 3
    star = starshapeness(shapes.star_prism(), detail=True)
    assert star.visible.fraction == 1
    low, high = star.profile.volume_share_bounds.T
    hull = 18  # half of 6 x 6, height 1
    assert (high >= shapes.STAR_PRISM.volume / hull).all()
    assert (np.diff(low) >= 0).all()


def test_domain_without_the_kernel():
    domain = (np.r_[np.eye(3), -np.eye(3)], [2, 2, 1, -1.5, 0, 0])  # 1.5 <= x: beyond the inner wall of the L
    score = starshapeness(shapes.l_prism(), domain=domain)
    assert score.verdict == "star-shaped"
    assert score.violation_bounds[0] > 0
    assert score.star_center[0] >= 1.5


def test_degenerate_kernels_have_no_defect():
    score = starshapeness(shapes.saw_prism())
    assert score.verdict == "degenerate"
    assert score.violation_bounds == (0, 0)


def test_profile():
    surface = shapes.l_prism()
    profile = defect_profile(surface, tolerances=[0.0, 0.2, 1.0], depth=5)
    low, high = profile.volume_share_bounds.T
    assert low[0] <= exact_kernel(surface).volume / profile.domain.volume <= high[0]
    assert profile.domain.volume == pytest.approx(3.5)  # the L and the triangle in its corner
    assert high[2] == 1
    assert (np.diff(profile.volume_share) >= 0).all()
    deeper = defect_profile(surface, tolerances=[0.0, 0.2, 1.0], depth=7, threads=2)
    assert (np.diff(deeper.volume_share_bounds) <= 0.5 * np.diff(profile.volume_share_bounds)).all()
    assert (deeper.volume_share_bounds[:, 0] >= low - 1e-9).all()
    assert repr(profile) == "DefectProfile(3 tolerances up to 1, depth=5)"
    assert profile.to_dict()["domain"] == "hull"


def test_default_profile():
    profile = defect_profile(shapes.torus(), depth=4)
    assert profile.tolerances[[0, 1, -1]] == pytest.approx([0, 0.02, 0.5])
    assert profile.volume_share_bounds.shape == (26, 2)
    assert profile.volume_share_bounds[0, 0] == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolerances": []}, "`tolerances` must hold at least one number; got none"),
        ({"tolerances": [-0.1]}, "`tolerances` must be >= 0"),
        ({"tolerances": [2.0]}, "`tolerances` must be at most 1, the whole surface; got 2"),
        ({"depth": 1}, r"`depth` must be in 3\.\.20; got 1"),
    ],
)
def test_bad_profiles(options, message):
    with pytest.raises(ValueError, match=message):
        defect_profile(shapes.cube(), **options)


def test_bad_gap():
    with pytest.raises(ValueError, match="`gap` must be > 0"):
        starshapeness(shapes.cube(), gap=0)
