"""Colours that mean something stay apart for protanopia, deuteranopia and tritanopia."""

import re
from importlib.resources import files
from itertools import combinations

import numpy as np
import pytest

from voxkernel._palette import APART as PARTS
from voxkernel._palette import INK, UNSEEN, distinct_color, hex_of
from voxkernel.pictures.fit_scene import UNEXPLAINED
from voxkernel.pictures.registration_picture import _SOURCE, _TARGET
from voxkernel.pictures.scene import CENTER, DOMAIN, KERNEL, RELAXED, SURFACE, WITNESS

# G. M. Machado and others, "A Physiologically-based Model for Simulation of Color Vision Deficiency", 2009: severity 1.
SEEN = {
    "all colours": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]],
}
APART = 20.0  # in CIE Lab, where 2.3 is just noticeable


def lab(color, seen):
    values = np.array([int(color[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    linear = np.clip(np.asarray(seen) @ linear, 0.0, 1.0)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    x, y, z = (np.cbrt(v) if v > 0.008856 else 7.787 * v + 16 / 116 for v in to_xyz @ linear / [0.9505, 1.0, 1.089])
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def of_the_report(name):
    css = (files("voxkernel.report") / "templates" / "report.css").read_text()
    return re.findall(rf"--{name}: (#[0-9a-f]{{6}});", css)[:2]  # on light and on dark


@pytest.mark.parametrize("vision", SEEN)
def test_colors_stay_apart(vision):
    light, dark = zip(*(of_the_report(name) for name in ("star", "flat", "not", "failed")), strict=True)
    parts = (*PARTS, hex_of(UNSEEN), UNEXPLAINED, INK, "#ffffff")
    fit = _SOURCE, _TARGET, UNEXPLAINED, "#ffffff"
    for colors in ((SURFACE, KERNEL, RELAXED, WITNESS, CENTER, DOMAIN, "#ffffff"), light, dark, parts, fit):
        for a, b in combinations(colors, 2):
            assert np.linalg.norm(lab(a, SEEN[vision]) - lab(b, SEEN[vision])) > APART, (a, b)


def test_no_part_is_as_red_as_what_is_unseen():
    red = lab(hex_of(UNSEEN), SEEN["all colours"])
    for k in range(60):
        assert np.linalg.norm(lab(hex_of(distinct_color(k)), SEEN["all colours"]) - red) > APART, k
