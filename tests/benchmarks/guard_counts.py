"""Guards for 99 % of many surfaces: counts, shares, bounds, CPU seconds of each stage, memory; `coacd` beside them.

    PYTHONPATH=tests python tests/benchmarks/guard_counts.py [models] [shapes] [sizes] [convex] [--json FILE]

Real models are those of `VOXKERNEL_DATA` (closed/ and asteroids/). The search may be tuned on the half "tuning" only;
the half is a hash of the file's name. Shapes by formula (`guard_shapes.py`) were never looked at while it was tuned. A
file that is there is gone on with: rows it holds are not made again.
"""

import argparse
import hashlib
import json
import os
import resource
import time
from pathlib import Path

from guard_shapes import UNSEEN_SHAPES

import voxkernel
from voxkernel.demo_shapes import torus

SIZES = {"torus 1.5k": (48, 16), "torus 31k": (160, 96), "torus 102k": (320, 160)}
CONVEX = ("letter S", "gc_bob_small", "linked tori", "common3d_spot")


def half_of(name):
    """Which half a model is in; the name decides."""
    return "tuning" if hashlib.sha256(name.encode()).digest()[0] % 2 == 0 else "reported"


def models():
    """Real models, by half."""
    folder = Path(os.environ.get("VOXKERNEL_DATA", Path(__file__).parents[3] / "shared" / "data"))
    for path in sorted([*folder.glob("closed/*.ply"), *folder.glob("asteroids/*.ply")]):
        yield half_of(path.name), path.stem, lambda path=path: voxkernel.as_mesh(path)


def shapes_by_formula():
    """Surfaces never tuned on."""
    yield from (("by formula", name, make) for name, make in UNSEEN_SHAPES.items())


def sizes():
    """One shape in three sizes."""
    yield from (("sizes", name, lambda n=n, m=m: torus(n_major=n, n_minor=m)) for name, (n, m) in SIZES.items())


def measured(mesh, *, bound):
    """Guards and pieces of a mesh, with the CPU seconds of each stage."""
    stages: dict[str, float] = {}
    last = ["search", time.process_time()]

    def told(state):
        now = time.process_time()
        stages[last[0]] = stages.get(last[0], 0.0) + now - last[1]
        last[:] = [state.stage, now]

    found = voxkernel.guards(mesh, bound=bound, progress=told)
    now = time.process_time()
    stages[last[0]] = stages.get(last[0], 0.0) + now - last[1]
    cover = voxkernel.star_cover(found)
    stages["pieces"] = time.process_time() - now
    proven = cover.verify()
    return {
        "facets": len(mesh.faces), "guards": len(found), "is_reached": found.is_reached, "seen": found.seen,
        "seen_low": found.seen_bounds[0], "certified": found.certified, "at_least": found.at_least,
        "at_least_for_samples": None if found.bound is None else found.bound.at_least_for_samples,
        "pieces": len(cover), "pieces_proven": proven, "reason": found.reason,
        "seconds": {stage: round(s, 3) for stage, s in stages.items()},
        "peak_memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
    }  # fmt: skip


def convex_rows(done):
    """Convex pieces of `coacd`, with its own defaults, of some of them."""
    import coacd

    coacd.set_log_level("error")
    makers = {name: make for _, name, make in [*models(), *shapes_by_formula()]}
    for name in CONVEX:
        if name not in makers or ("convex pieces", name) in done:
            continue
        mesh = makers[name]()
        begin = time.process_time()
        parts = coacd.run_coacd(coacd.Mesh(mesh.vertices, mesh.faces))
        yield {"group": "convex pieces", "name": name, "facets": len(mesh.faces), "pieces": len(parts),
               "seconds": {"coacd": round(time.process_time() - begin, 3)}}  # fmt: skip


def rows_of(what, done):
    """Rows not there yet."""
    if what == "convex":
        yield from convex_rows(done)
        return
    source = {"models": models, "shapes": shapes_by_formula, "sizes": sizes}[what]()
    for group, name, make in source:
        if (group, name) not in done:
            yield {"group": group, "name": name, **measured(make(), bound=what != "sizes")}


def main():
    """Print rows as they come and write them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", nargs="*", default=["models", "shapes", "sizes", "convex"])
    parser.add_argument("--json")
    args = parser.parse_args()
    out = None if args.json is None else Path(args.json)
    rows = json.loads(out.read_text()) if out is not None and out.exists() else []
    voxkernel.guards(torus(n_major=12, n_minor=8), coverage=0.5, bound=True)  # what is imported once
    for what in args.what:
        for row in rows_of(what, {(r["group"], r["name"]) for r in rows}):
            rows.append(row)
            print(json.dumps(row), flush=True)
            if out is not None:
                out.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
