"""Pairs that show different parts of one object, or none of it: clutter, crops of both, range scans, what to refuse."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from registration_changes import (
    before_a_plane,
    both_cropped,
    divided,
    extent,
    mirrored,
    turned_over,
    with_shoulders,
)
from registration_pairs import CLOSED, Pair, arrays, cropped, decimated, noisy, posed, range_scans


def partial_rows(data: Path, count: int, first: int = 0) -> Iterator[Pair]:
    """Faces on their scans with clutter, both cropped, in other densities, or with the facets of one turned over."""
    import numpy as np

    truth = json.loads((data / "scans" / "ground_truth.json").read_text())["scans"]
    for number, (name, entry) in enumerate(list(truth.items())[:count], start=first):
        face, scan = arrays(data / entry["reference"]), arrays(data / "scans" / name)
        known = np.array(entry["T_ref_to_scan"])
        yield posed("a plane behind", number, face, before_a_plane(scan), known)
        yield posed("shoulders below", number, face, with_shoulders(scan), known)
        moved = face[0] @ known[:3, :3].T + known[:3, 3], face[1]
        for percent in (30, 40, 45):
            one, two = both_cropped(moved, scan, percent / 100, 100 * number + percent)
            yield posed(f"both cropped {percent} %", number, one, two, np.eye(4))
        cut = noisy(cropped(scan, 0.5, number), 2.0, number)
        yield posed("50 % cropped, 2 mm noise", number, face, cut, known)
        yield posed("80 % cropped", number, face, cropped(scan, 0.8, number), known)
        yield posed("180,000 against 500 facets", number, decimated(face, 500), divided(scan, 150_000), known)
        yield posed("facets turned over", number, face, turned_over(scan), known)


def body_rows(data: Path, count: int, first: int = 0) -> Iterator[Pair]:
    """Closed bodies and asteroids, remeshed or thinned, cut in half."""
    import numpy as np

    for number, name in enumerate(CLOSED[:count], start=first):
        body = arrays(data / "closed" / f"{name}.ply")
        light = noisy(decimated(body, max(400, int(0.6 * len(body[1])))), 0.001 * extent(body), number)
        yield posed("closed body, 50 % cropped", number, body, cropped(light, 0.5, number), np.eye(4))
    for number, path in enumerate(sorted((data / "asteroids").glob("*.ply"))[:count], start=first):
        body = arrays(path)
        light = noisy(decimated(body, 4000), 0.001 * extent(body), number)
        yield posed("asteroid, 50 % cropped", number, body, cropped(light, 0.5, number), np.eye(4))


def refused_rows(data: Path, count: int, first: int = 0) -> Iterator[Pair]:
    """Pairs without a right answer: other objects, other sizes, mirror images, parts that have nothing in common."""
    import numpy as np

    truth = json.loads((data / "scans" / "ground_truth.json").read_text())["scans"]
    names = list(truth)
    for number, (name, entry) in enumerate(list(truth.items())[:count], start=first):
        face, scan = arrays(data / entry["reference"]), arrays(data / "scans" / name)
        body = arrays(data / "closed" / f"{CLOSED[number % len(CLOSED)]}.ply")
        other = arrays(data / "closed" / f"{CLOSED[(number + 3) % len(CLOSED)]}.ply")
        rocks = sorted((data / "asteroids").glob("*.ply"))
        turn, which = divmod(number - first, len(rocks))
        rock = decimated(arrays(rocks[which]), 6000 - 300 * turn)
        same_size = other[0] * (extent(body) / extent(other)), other[1]
        stranger = arrays(data / "scans" / names[(number + 1) % len(names)])
        one, two = both_cropped(body, body, 0.5, number)
        for row, source, target in (
            ("refuse: a body on a face", face, (body[0] * (extent(face) / extent(body)), body[1])),
            ("refuse: another closed body", body, same_size),
            ("refuse: another person's scan", face, stranger),
            ("refuse: scale 1.1", face, (scan[0] * 1.1, scan[1])),
            ("refuse: scale 2", face, (scan[0] * 2.0, scan[1])),
            ("refuse: mirror image", rock, mirrored(rock)),
            ("refuse: two halves", one, two),
        ):
            yield replace(posed(row, number, source, target, np.eye(4)), T_target_source=None)


def range_rows(data: Path, most: int, first: int = 0) -> Iterator[Pair]:
    """Real range scans, by overlap; those without are to be refused."""
    for _, overlap, pair in range_scans(data, most, first):
        word = "0.5 and more" if overlap >= 0.5 else "0.3 to 0.5" if overlap >= 0.3 else "0.15 to 0.3"
        if overlap < 0.05:
            yield replace(pair, row="refuse: range scans, overlap below 0.05", T_target_source=None)
        elif overlap >= 0.15:
            yield replace(pair, row=f"range scans, overlap {word}")


def size_rows(data: Path, count: int, first: int = 0) -> Iterator[Pair]:
    """A face on its scan, every facet cut in four until there are enough; for seconds."""
    import numpy as np

    truth = json.loads((data / "scans" / "ground_truth.json").read_text())["scans"]
    name, entry = list(truth.items())[2]
    face, scan = arrays(data / entry["reference"]), arrays(data / "scans" / name)
    for least in (1, 40_000, 100_000, 400_000)[:count]:
        source, target = divided(face, least), divided(scan, least)
        row = f"{len(source[1]):,} and {len(target[1]):,} facets"
        yield posed(row, first, source, target, np.array(entry["T_ref_to_scan"]))


ROWS: dict[str, Any] = {"partial": partial_rows, "bodies": body_rows, "refused": refused_rows}
