"""`datasets_tools/make_labels.py`: the library finds in the images what the formulas say."""

import csv

import numpy as np
import pytest

import voxkernel

pytestmark = pytest.mark.usefixtures("datasets_tools")


# Flat sides in any pose are stairs of voxels: a point that sees along them sees less of the voxels than of the solid.
LEAST_SEEN = {"ball": 1.0, "ellipsoid": 1.0, "starfish": 0.95, "l": 0.9, "sheet": 0.0}


def test_truth_of_the_formulas(tmp_path):
    from make_labels import main

    assert main([str(tmp_path / "out"), "--sizes", "20", "--count", "2", "-q"]) == 0
    with (tmp_path / "out" / "manifest.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 12 * 2
    for row in rows[::2]:
        stars = voxkernel.label_stars(tmp_path / "out" / row["file"], n_rays=(32,))
        own = [other for other in rows if other["file"] == row["file"]]
        assert stars.label.tolist() == [int(other["object"]) for other in own]
        assert stars.fragments.tolist() == [int(other["fragments"]) for other in own]
        assert stars.holes.tolist() == [int(other["holes"]) for other in own]
        assert stars.is_certified.all()
        for k, other in enumerate(own):
            if other["volume"]:
                assert stars.voxels[k] == pytest.approx(float(other["volume"]), rel=0.06)
            if other["is_star_shaped"] == "no":
                assert stars.visible[k] < 0.8
            elif other["is_star_shaped"] == "yes":
                assert stars.visible[k] >= LEAST_SEEN[other["family"]]


def test_an_object_does_not_depend_on_the_others(tmp_path):
    from make_labels import write_labels

    for name in ("one", "two"):
        (tmp_path / name).mkdir()
    write_labels(tmp_path / "one", families=["bean"], sizes=[12], count=4)
    write_labels(tmp_path / "two", families=["ball", "bean"], sizes=[8, 12], count=2)
    one, two = (np.load(tmp_path / name / "bean-12.npz")["labels"] for name in ("one", "two"))
    assert np.array_equal(one[: len(two)], two)


@pytest.mark.parametrize("words", [["--sizes", "3"], ["--sizes", "x"], ["--families", "cube"], ["--seed", "-1"]])
def test_bad_usage_of_make_labels(tmp_path, capsys, words):
    from make_labels import main

    assert main([str(tmp_path / "out"), *words]) == 2
    assert " must be " in capsys.readouterr().err
