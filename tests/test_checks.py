import numpy as np
import pytest

from voxkernel._checks import (
    as_choice,
    as_depth,
    as_facet_ids,
    as_indices,
    as_integers,
    as_nonnegative,
    as_points,
    as_positive,
    as_real,
    check_index_range,
    read_only,
)
from voxkernel.errors import MeshError


def test_points_are_float64_contiguous_and_copied_only_on_request():
    given = np.arange(6, dtype=np.float64).reshape(2, 3)
    assert as_points("p", given) is given or np.shares_memory(as_points("p", given), given)
    assert not np.shares_memory(as_points("p", given, copy=True), given)
    points = as_points("p", np.asfortranarray(np.ones((4, 3), dtype=np.float32)))
    assert points.dtype == np.float64
    assert points.flags.c_contiguous
    assert as_points("p", []).shape == (0, 3)
    assert as_points("p", [[1, 2]], columns=2).shape == (1, 2)


@pytest.mark.parametrize(
    ("value", "kind", "text"),
    [
        ([[1.0, 2.0]], ValueError, r"`p` must have shape \(n, 3\); got \(1, 2\)"),
        ([1.0, 2.0, 3.0], ValueError, r"`p` must have shape \(n, 3\); got \(3,\)"),
        ([[1.0, 2.0, 3.0], [1.0]], ValueError, "rows of different lengths"),
        ([[0, 0, 0], [0, np.nan, 0]], ValueError, "`p` must be finite; got nan in row 1"),
        ([[0, 0, -np.inf]], ValueError, "`p` must be finite; got -inf in row 0"),
        ([["a", "b", "c"]], TypeError, "`p` must be an array of real numbers; got dtype"),
        ([[1j, 0, 0]], TypeError, "real numbers"),
        ([[True, False, True]], TypeError, "real numbers"),
        (None, TypeError, "real numbers"),
    ],
)
def test_points_refuse(value, kind, text):
    with pytest.raises(kind, match=text):
        as_points("p", value)


def test_points_raise_the_class_asked_for():
    with pytest.raises(MeshError, match="finite"):
        as_points("p", [[np.nan, 0, 0]], error=MeshError)


def test_integers():
    assert as_integers("f", np.ones((2, 3), np.uint8), shape="(m, 3)", ndim=2, columns=3).dtype == np.int64
    assert as_integers("f", [], shape="(m, 3)", ndim=2, columns=3).shape == (0, 3)
    with pytest.raises(TypeError, match="`f` must be an array of integers; got dtype float64"):
        as_integers("f", [[0.0, 1.0, 2.0]], shape="(m, 3)", ndim=2)
    with pytest.raises(TypeError, match="got dtype bool"):
        as_integers("f", [True], shape="(n,)", ndim=1)
    with pytest.raises(ValueError, match=r"`f` must have shape \(m, 3\); got \(12, 4\)"):
        as_integers("f", np.zeros((12, 4), int), shape="(m, 3)", ndim=2, columns=3)
    with pytest.raises(ValueError, match="different lengths"):
        as_integers("f", [[0, 1], [2]], shape="(m, 3)", ndim=2)
    with pytest.raises(ValueError, match="must fit in int64"):
        as_integers("f", np.array([2**64 - 1], np.uint64), shape="(n,)", ndim=1)


def test_indices():
    assert as_indices("i", [2, 0], upper=3).tolist() == [2, 0]
    assert as_indices("i", [], upper=0).size == 0
    with pytest.raises(ValueError, match=r"`i` must be in 0\.\.2; got 3"):
        as_indices("i", [0, 3], upper=3)
    with pytest.raises(ValueError, match=r"`i` must be in 0\.\.2; got -1"):
        as_indices("i", [-1], upper=3)
    with pytest.raises(MeshError):
        check_index_range("i", np.array([9]), 3, error=MeshError)


def test_facet_ids():
    assert as_facet_ids("facets", [3, 1, 3], upper=4).tolist() == [1, 3]
    assert as_facet_ids("facets", np.array([True, False, True]), upper=3).tolist() == [0, 2]
    with pytest.raises(ValueError, match=r"`facets` as a mask must have shape \(3,\); got \(2,\)"):
        as_facet_ids("facets", [True, False], upper=3)
    with pytest.raises(TypeError, match="integers"):
        as_facet_ids("facets", [0.5], upper=3)


def test_reals():
    assert as_real("x", np.float32(0.5)) == 0.5
    assert as_positive("x", 2) == 2.0
    assert as_nonnegative("x", 0) == 0.0
    with pytest.raises(ValueError, match="`x` must be > 0; got 0"):
        as_positive("x", 0.0)
    with pytest.raises(ValueError, match="`x` must be >= 0; got -1"):
        as_nonnegative("x", -1)
    with pytest.raises(ValueError, match="`x` must be finite; got nan"):
        as_real("x", float("nan"))
    for wrong in ("1", None, True, [1, 2]):
        with pytest.raises(TypeError, match="`x` must be a real number; got"):
            as_real("x", wrong)


def test_depth_and_choice():
    assert as_depth("depth", np.int32(4), 1, 10) == 4
    with pytest.raises(ValueError, match=r"`depth` must be in 1\.\.10; got 11"):
        as_depth("depth", 11, 1, 10)
    for wrong in (3.0, True, "3", None):
        with pytest.raises(TypeError, match="`depth` must be an integer; got"):
            as_depth("depth", wrong, 1, 10)
    assert as_choice("mode", "b", ("a", "b")) == "b"
    with pytest.raises(ValueError, match="`mode` must be one of 'a', 'b'; got 'c'"):
        as_choice("mode", "c", ("a", "b"))


def test_read_only_is_the_same_array():
    array = np.zeros(3)
    assert read_only(array) is array
    with pytest.raises(ValueError, match="read-only"):
        array[0] = 1.0
