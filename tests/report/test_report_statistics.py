import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy import stats

from voxkernel.report.statistics import area_under, average_ranks, confusion_counts, quantiles, roc_curve, spearman

SCORES = st.lists(st.tuples(st.integers(-3, 3).map(float), st.booleans()), min_size=1, max_size=40)


def brute_force_area(scores, positive):
    """All pairs of a positive and a negative: won 1, tied 1/2."""
    won = [(p > n) + (p == n) / 2 for p in scores[positive] for n in scores[~positive]]
    return sum(won) / len(won) if won else float("nan")


@given(SCORES)
def test_area_is_the_share_of_pairs_won(items):
    scores, positive = np.array([s for s, _ in items]), np.array([p for _, p in items])
    curve = roc_curve(scores, positive)
    expected = brute_force_area(scores, positive)
    assert curve.area == pytest.approx(expected, abs=1e-14, nan_ok=True)
    assert (curve.n_positive, curve.n_negative) == (positive.sum(), (~positive).sum())
    # The area is also the one under the curve as drawn, and SciPy's Mann-Whitney statistic.
    assume(curve.n_positive and curve.n_negative)
    x, y = curve.false_positive_rate, curve.true_positive_rate
    drawn = np.sum(np.diff(x) * (y[1:] + y[:-1]) / 2)
    assert drawn == pytest.approx(expected, abs=1e-12)
    u = stats.mannwhitneyu(scores[positive], scores[~positive], method="asymptotic").statistic
    assert u / (curve.n_positive * curve.n_negative) == pytest.approx(expected, abs=1e-12)


@given(SCORES)
def test_each_point_of_the_curve_is_a_threshold(items):
    scores, positive = np.array([s for s, _ in items]), np.array([p for _, p in items])
    curve = roc_curve(scores, positive)
    assume(curve.n_positive and curve.n_negative)
    thresholds = [np.inf, *sorted(set(scores), reverse=True)]
    assert curve.false_positive_rate.tolist() == pytest.approx(
        [np.mean(scores[~positive] >= t) for t in thresholds], abs=1e-15
    )
    assert curve.true_positive_rate.tolist() == pytest.approx(
        [np.mean(scores[positive] >= t) for t in thresholds], abs=1e-15
    )


@given(SCORES)
def test_area_of_the_turned_score_is_the_rest(items):
    scores, positive = np.array([s for s, _ in items]), np.array([p for _, p in items])
    assume(positive.any() and not positive.all())
    assert area_under(-scores, positive) == pytest.approx(1 - area_under(scores, positive), abs=1e-14)
    assert area_under(scores, ~positive) == pytest.approx(1 - area_under(scores, positive), abs=1e-14)


def test_roc_by_hand():
    curve = roc_curve([3, 2, 1, 0], [True, True, False, False])
    assert curve.area == 1.0
    assert roc_curve([0, 0], [True, False]).area == 0.5
    assert roc_curve([0.5, np.nan, np.inf, -np.inf], [True, False, True, False]).area == 1.0
    assert roc_curve([0.5, np.nan, np.inf, -np.inf], [True, False, True, False]).n_negative == 1
    assert not curve.true_positive_rate.flags.writeable
    for empty in (roc_curve([], []), roc_curve([1.0], [True]), roc_curve([1.0], [False])):
        assert np.isnan(empty.area)
        assert empty.true_positive_rate.tolist() == [0.0, 1.0]
    with pytest.raises(ValueError, match=r"`positive` must have the length of `scores`; got \(1,\) and \(2,\)"):
        roc_curve([1.0, 2.0], [True])


@given(st.lists(st.tuples(st.integers(-4, 4), st.integers(-4, 4)), min_size=2, max_size=40))
def test_spearman_is_scipys(pairs):
    a, b = np.array(pairs, dtype=np.float64).T
    rho, n = spearman(a, b)
    assert n == len(pairs)
    assert average_ranks(a).tolist() == stats.rankdata(a).tolist()
    if len(set(a)) == 1 or len(set(b)) == 1:
        assert np.isnan(rho)
    else:
        assert rho == pytest.approx(stats.spearmanr(a, b).statistic, abs=1e-12)


def test_spearman_leaves_nan_out():
    rho, n = spearman([1, 2, np.nan, 4], [3, 2, 9, 1])
    assert (round(rho, 12), n) == (-1.0, 3)
    assert spearman([1.0], [2.0])[1] == 1
    assert np.isnan(spearman([np.nan, 1.0], [2.0, 3.0])[0])
    assert spearman([1, 2, 3], [-np.inf, 0, np.inf])[0] == pytest.approx(1.0)
    with pytest.raises(ValueError, match="`b` must have the length of `a`"):
        spearman([1.0, 2.0], [1.0])


@given(st.lists(st.tuples(st.sampled_from("abc"), st.sampled_from("xyz")), max_size=30))
def test_confusion_is_a_count(pairs):
    truths, answers = [t for t, _ in pairs], [a for _, a in pairs]
    counts = confusion_counts(truths, answers, "ab", "xyz")
    for i, t in enumerate("ab"):
        for j, a in enumerate("xyz"):
            assert counts[i, j] == pairs.count((t, a))
    with pytest.raises(ValueError, match="`answers` must have the length of `truths`"):
        confusion_counts([*truths, "a"], answers, "ab", "xyz")


def test_quantiles():
    assert quantiles([0, 1, np.nan, 2, 3, 4], (0.0, 0.25, 0.5, 1.0)) == [0.0, 1.0, 2.0, 4.0]
    assert np.isnan(quantiles([np.nan], (0.5,))).all()
