"""Run by the system's Python, which has pyopenvdb: writes and reads .vdb files for test_vdb_independent.py.

Usage: python openvdb_peer.py make FOLDER | python openvdb_peer.py dump OUT.npz IN.vdb ...
"""

import json
import os
import sys

import numpy as np
import pyopenvdb as vdb

LOW, EDGE = -40, 80  # the dense box that is compared, inactive values included


def dump(paths):
    """Everything that pyopenvdb says about each file, as flat arrays and JSON."""
    arrays, facts = {}, []
    for n, path in enumerate(paths):
        grids, metadata = vdb.readAll(path)
        fact = {"path": path, "metadata": metadata, "grids": []}
        for m, grid in enumerate(grids):
            tiles = [(v.min, v.max, v.value) for v in grid.citerOnValues() if v.min != v.max]
            boxes = np.array([(*low, *high) for low, high, _ in tiles], dtype=np.int64)
            arrays[f"{n}.{m}.tiles"] = boxes.reshape(-1, 6)
            arrays[f"{n}.{m}.tile_values"] = np.array([value for _, _, value in tiles], dtype=np.float32)
            voxels = [(v.min, v.value) for v in grid.citerOnValues() if v.min == v.max]
            arrays[f"{n}.{m}.voxels"] = np.array([v[0] for v in voxels], dtype=np.int64).reshape(-1, 3)
            arrays[f"{n}.{m}.values"] = np.array([v[1] for v in voxels], dtype=np.float32)
            is_bool = isinstance(grid, vdb.BoolGrid)
            if not isinstance(grid, vdb.Vec3SGrid):
                dense = np.zeros((EDGE,) * 3, dtype=bool if is_bool else np.float32)
                grid.copyToArray(dense, ijk=(LOW,) * 3)
                arrays[f"{n}.{m}.dense"] = dense
            to_world = grid.transform.indexToWorld
            frame = [to_world(p) for p in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))]
            fact["grids"].append(
                {
                    "name": grid.name,
                    "class": grid.gridClass,
                    "type": grid.valueTypeName,
                    "half": grid.saveFloatAsHalf,
                    "background": float(np.mean(grid.background)),
                    "count": grid.activeVoxelCount(),
                    "leaves": grid.leafCount(),
                    "bbox": grid.evalActiveVoxelBoundingBox(),
                    "metadata": grid.metadata,
                    "frame": frame,
                }
            )
        facts.append(fact)
    return arrays, facts


def turned():
    transform = vdb.createLinearTransform([[0.5, 0, 0, 0], [0, 0.25, 0, 0], [0, 0, 2, 0], [1, 2, 3, 1]])
    transform.rotate(0.7, vdb.Axis.X)
    transform.rotate(-0.3, vdb.Axis.Z)
    transform.translate((10, -20, 30))
    return transform


def make(folder):
    """Files of every kind the reader claims to know, as real OpenVDB writes them."""
    rng = np.random.default_rng(7)

    def save(name, grids, metadata=None):
        vdb.write(os.path.join(folder, name + ".vdb"), grids=grids, metadata=metadata or {})

    mask = vdb.BoolGrid()
    mask.name = "tiles"
    mask.fill((-8192, -4096, 0), (4095, -1, 4095), True)
    mask.fill((0, 0, 0), (127, 255, 127), True)
    mask.fill((-20, 3, -9), (-5, 30, 20), True)
    mask.transform = turned()
    entries = {"author": "peer", "n": 3, "x": 0.5, "yes": True, "v": (1, 2, 3), "w": (0.5, 1.0, 2.0)}
    save("bool_tiles", mask, entries)

    odd = vdb.BoolGrid(True)
    odd.fill((0, 0, 0), (20, 20, 20), False, active=True)
    odd.fill((-16, -16, -16), (-1, -1, -1), False, active=False)
    save("bool_odd", odd)

    field = vdb.FloatGrid(2.5)
    field.name = "field"
    field.copyFromArray(rng.choice(np.float32([2.5, 0, -2.5, 1, 7]), (23, 30, 17)), ijk=(-11, -9, -30))
    field.fill((-8, -8, -8), (7, 7, 7), -2.5, active=False)
    field.fill((128, 0, 0), (255, 127, 127), 4.5)
    field.transform = turned()
    field["alpha"] = 0.25
    field["source"] = "peer.ply"
    save("float_field", field)

    sphere = vdb.createLevelSetSphere(radius=6.0, center=(1, -2, 0.5), voxelSize=0.3, halfWidth=3)
    sphere.name = "sphere"
    save("level_set", sphere)

    half = sphere.deepCopy()
    half.saveFloatAsHalf = True
    half.name = "half"
    fog = vdb.FloatGrid()
    fog.name = "fog"
    fog.gridClass = vdb.GridClass.FOG_VOLUME
    fog.copyFromArray((rng.random((20, 20, 20)) * (rng.random((20, 20, 20)) < 0.3)).astype(np.float32))
    save("several", [half, fog, mask, sphere])

    shared = fog.copy()
    shared.name = "shared"
    save("instances", [fog, shared])
    save("empty", [vdb.BoolGrid(), vdb.FloatGrid(3.0)])
    save("vectors", [vdb.Vec3SGrid(), fog])


if __name__ == "__main__":
    if sys.argv[1] == "make":
        make(sys.argv[2])
    else:
        found, told = dump(sys.argv[3:])
        np.savez(sys.argv[2], facts=json.dumps(told), **found)
