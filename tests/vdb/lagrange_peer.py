"""adobe-lagrange (OpenVDB 13) in its own process, since its TBB and Open3D's cannot share one.

Usage: python lagrange_peer.py make FOLDER | python lagrange_peer.py dump OUT.npz IN.vdb ...
"""

import json
import sys
from pathlib import Path

import lagrange
import numpy as np
from lagrange import volume

BOX = (np.indices((80, 80, 80)).reshape(3, -1).T - 40).astype(np.int32)
COMPRESSIONS = ("Uncompressed", "Zip", "Blosc")


def described(grid, key):
    """What lagrange says about a grid; values at whole indices need no interpolation."""
    fact = {
        "name": grid.name,
        "count": grid.num_active_voxels,
        "bbox": grid.bbox_index.tolist(),
        "transform": grid.transform.tolist(),
    }
    try:
        fact["background"] = float(grid.background)
    except RuntimeError:  # a grid without numbers: "Unsupported grid type"
        return fact, {}
    return fact, {key: grid.sample_trilinear_index_space(BOX)}


def make(folder):
    rng = np.random.default_rng(3)
    cells = np.unique(rng.integers(-5000, 5000, (300, 3)), axis=0)
    block = np.indices((9, 9, 9)).reshape(3, -1).T - 4
    cells = np.concatenate([cells, block]).astype(np.int32)
    values = rng.normal(size=len(cells)).astype(np.float32)
    points = volume.Grid.from_points(cells, values)
    points.name = "points"
    mesh = lagrange.SurfaceMesh()
    mesh.add_vertices(np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]], dtype=float))
    for face in ([0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]):
        mesh.add_triangle(*face)
    level_set = volume.Grid.from_mesh(mesh, voxel_size=0.37)
    facts, arrays = {}, {"cells": cells, "values": values}
    for name, grid in (("points", points), ("level_set", level_set)):
        facts[name], found = described(grid, name)
        arrays |= found
        for compression in COMPRESSIONS:
            grid.save(folder / f"{name}_{compression}.vdb", getattr(volume.Compression, compression))
    np.savez(folder / "made.npz", facts=json.dumps(facts), **arrays)


def dump(out, paths):
    facts, arrays = [], {}
    for n, path in enumerate(paths):
        fact, found = described(volume.Grid.load(path), str(n))
        facts.append(fact)
        arrays |= found
    np.savez(out, facts=json.dumps(facts), **arrays)


if __name__ == "__main__":
    if sys.argv[1] == "make":
        make(Path(sys.argv[2]))
    else:
        dump(sys.argv[2], sys.argv[3:])
