"""Plain values and JSON: nothing of NumPy is left, and no NaN."""

import json

import numpy as np
import pytest

from voxkernel._plain import json_text, plain


def types_in(value):
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return {type(value)}.union(*(types_in(item) for item in inner))


def test_values_are_those_of_python():
    document = {
        1: (np.int8(3), np.float32(0.5), np.bool_(True)),
        "array": np.array([[1.0, np.nan], [np.inf, -0.0]]),
        "number": np.array(7),
        "text": np.str_("a"),
        "nested": [{"none": None}, np.arange(2)],
    }
    found = plain(document)
    assert found == {
        "1": [3, 0.5, True], "array": [[1.0, None], [None, 0.0]], "number": 7, "text": "a",
        "nested": [{"none": None}, [0, 1]],
    }  # fmt: skip
    assert types_in(found) <= {dict, list, int, float, bool, str, type(None)}


@pytest.mark.parametrize("value", [float("nan"), np.float64("inf"), -np.inf, np.array(np.nan)])
def test_what_is_no_number_is_none(value):
    assert plain(value) is None


def test_finite_floats_keep_their_bits():
    values = [0.1, 5e-324, 1.7976931348623157e308, -0.0]
    again = json.loads(json_text(np.array(values)))
    assert [v.hex() for v in again] == [v.hex() for v in values]


def test_layout():
    document = {"b": float("nan"), "a": [1, "é"]}
    assert json_text(document) == '{"b": null, "a": [1, "\\u00e9"]}'
    assert json_text(document, sort_keys=True, ensure_ascii=False, separators=(",", ":")) == '{"a":[1,"é"],"b":null}'
    assert json_text([1], indent=1) == "[\n 1\n]"


def test_what_json_has_no_form_for_is_an_error():
    with pytest.raises(TypeError, match="not JSON serializable"):
        json_text({"a": object()})
