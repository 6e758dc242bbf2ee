"""Which objects of label images are drawn: the worst of each image, told from its rows, however these came."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from voxkernel._extras import optional
from voxkernel.evaluation.inputs import Item
from voxkernel.evaluation.label_rows import most_pictures, worst_first
from voxkernel.evaluation.object_group import ObjectGroup
from voxkernel.run_index import RunIndex

__all__ = ["COLUMNS", "undrawn"]

COLUMNS = ("status", "thumbnail", "shortfall")  # beside the keys
_JUDGED = ["file", "object", "shortfall", "voxels", "voxels_seen", "iou", "thumbnail"]


def undrawn(items: Sequence[Item], index: RunIndex) -> list[Item]:
    """Give images whose worst objects have no pictures yet, with these objects and their rows.

    A picture that is not known yet is null in a row; where there is to be none it is "".
    """
    pa, compute, keys = optional("pyarrow"), optional("pyarrow.compute"), index.keys
    waits = compute.and_(compute.is_null(keys["thumbnail"]), compute.not_equal(keys["shortfall"].fill_null(""), ""))
    waiting = set(compute.unique(keys["file"].filter(waits)).to_pylist())
    found: list[Item] = []
    for item in items:
        if item.name not in waiting:
            continue
        places = np.flatnonzero(compute.equal(keys["file"], item.name).to_numpy())
        short = compute.not_equal(keys["shortfall"].take(pa.array(places)).fill_null(""), "").to_numpy()
        places = places[short]
        own = index.rows(places).select(_JUDGED)
        overlap = [values[-1] for values in own["iou"].to_pylist()]
        order = worst_first(own["voxels_seen"].to_pylist(), overlap)
        n_objects = int(keys["n_objects"][int(places[0])].as_py())
        chosen = np.sort(order[: most_pictures(n_objects)])
        chosen = chosen[compute.is_null(own["thumbnail"]).to_numpy()[chosen]]
        if len(chosen):
            found.append(_to_draw(item, index.rows(places[chosen]).to_pylist(), n_objects))
    return found


def _to_draw(item: Item, rows: list[dict[str, Any]], n_objects: int) -> Item:
    ids = np.array([row["object"] for row in rows], np.int64)
    work = np.array([float(row["voxels"]) for row in rows])
    group = ObjectGroup(ids, work, n_objects, tuple(rows))
    return replace(item, known_hash=rows[0]["content_hash"], finished=rows[0]["finished"], done=None, group=group)
