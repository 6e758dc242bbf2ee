"""What another library needs for the cases of test_grid.py; run by the Python that has it, prints JSON.

Usage: python vdb_peer.py pyopenvdb|tinyvdb|xuvdb FOLDER ROUNDS
"""

import json
import os
import sys
import time

import numpy as np

N_QUERIES = 200_000


def best(call, rounds):
    """Seconds of the fastest round."""
    seconds = []
    for _ in range(rounds):
        begin = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - begin)
    return min(seconds)


def pyopenvdb(folder, rounds):
    import pyopenvdb as vdb

    found = {"version": ".".join(map(str, vdb.LIBRARY_VERSION))}
    dense, values = np.load(os.path.join(folder, "dense.npy")), np.load(os.path.join(folder, "values.npy"))
    whole = np.empty(values.shape, np.float32)

    def built(kind, array):
        grid = kind()
        grid.copyFromArray(array)
        grid.name = "grid"
        return grid

    def read_all(path):
        # OpenVDB loads values when they are first touched: copying them out, minus a second copy, is what that costs.
        begin = time.perf_counter()
        grid = vdb.read(path, "grid")
        opened = time.perf_counter()
        grid.copyToArray(whole, ijk=(0, 0, 0))
        touched = time.perf_counter()
        grid.copyToArray(whole, ijk=(0, 0, 0))
        return opened - begin + max(0.0, (touched - opened) - (time.perf_counter() - touched))

    found["10M mask build"] = best(lambda: built(vdb.BoolGrid, dense), rounds)
    found["10M float build"] = best(lambda: built(vdb.FloatGrid, values), rounds)
    out = os.path.join(folder, "peer.vdb")
    for case in ("10M mask", "10M float", "kernel"):
        path = os.path.join(folder, f"{case}.vdb")
        grid = vdb.read(path, "grid")
        if case == "10M float":
            found[f"{case} read"] = min(read_all(path) for _ in range(rounds))
        else:
            found[f"{case} read"] = best(lambda path=path: vdb.read(path, "grid"), rounds)
        found[f"{case} write"] = best(lambda grid=grid: vdb.write(out, [grid]), rounds)
        if case == "10M float":
            continue
        voxels = [tuple(row) for row in np.load(os.path.join(folder, f"{case}.npy"))[:N_QUERIES].tolist()]
        is_on = grid.getConstAccessor().isValueOn
        found[f"{case} query of 1M"] = best(lambda v=voxels, f=is_on: [f(p) for p in v], 2) * 1e6 / len(voxels)
        other = vdb.read(os.path.join(folder, f"{case} other.vdb"), "grid")
        pairs = [(grid.deepCopy(), other.deepCopy()) for _ in range(2)]
        found[f"{case} intersection"] = best(
            lambda pairs=pairs: (lambda a, b: a.combine(b, lambda x, y: x and y))(*pairs.pop()), 2
        )
    return found


def tinyvdb(folder, rounds):
    import tinyvdb as vdb

    path, out = os.path.join(folder, "10M float.vdb"), os.path.join(folder, "peer.vdb")

    def read():
        file = vdb.open(path)
        file.read_grids()
        return file

    file = read()
    return {"10M float read": best(read, rounds), "10M float write": best(lambda: file.save(out), rounds)}


def xuvdb(folder, rounds):
    import xuvdb as vdb

    path, out = os.path.join(folder, "10M float.vdb"), os.path.join(folder, "peer.vdb")
    grids = vdb.read_vdb(path)
    return {
        "10M float read": best(lambda: vdb.read_vdb(path), rounds),
        "10M float write": best(lambda: vdb.write_vdb(out, grids), rounds),
    }


if __name__ == "__main__":
    told = {"pyopenvdb": pyopenvdb, "tinyvdb": tinyvdb, "xuvdb": xuvdb}[sys.argv[1]](sys.argv[2], int(sys.argv[3]))
    print(json.dumps(told))
