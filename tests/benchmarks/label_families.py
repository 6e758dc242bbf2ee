"""`label_stars` on families of near-star and concave objects by formula: objects a second, V*, share certified.

    python tests/benchmarks/label_families.py --size 40 --objects 20 --seed 57 --json FILE
    python tests/benchmarks/label_families.py --size 20 --families l,two-lobes,torus

With `PYTHONPATH` at another checkout it measures that version. Families are those of `label_formulas.py` and some more;
object k of a family depends only on the seed, the size and k. CPU time, the least of some rounds, all objects of a
family in one image in random poses.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[2] / "datasets_tools"))
from label_formulas import FAMILIES as WITH_TRUTH
from label_formulas import Solid, voxels

from voxkernel import label_stars


def directions(rng, n):
    """Unit vectors at random."""
    v = rng.normal(size=(n, 3))
    return v / np.linalg.norm(v, axis=1)[:, None]


def lobed(rng, n, low, high, sharp, axes=(1, 1, 1)):
    """A radius that bumps and dents change, the largest within the ball of radius 1."""
    bumps = list(zip(directions(rng, n), rng.uniform(low, high, n), strict=True))

    def inside(p):
        q = p / np.asarray(axes)
        length = np.sqrt((q**2).sum(-1))
        unit = q / np.maximum(length, 1e-9)[..., None]
        return length < np.minimum(0.7 + sum(h * np.exp(sharp * (unit @ d - 1)) for d, h in bumps), 1)

    return inside


def tube(path, thick):
    """What is within a distance of a curve."""

    def inside(p):
        from scipy.spatial import cKDTree

        return cKDTree(path).query(p.reshape(-1, 3))[0].reshape(p.shape[:-1]) < thick

    return inside


def two_lobes(rng):
    """Two balls that overlap a little."""
    apart = rng.uniform(0.4, 0.48)
    return lambda p: (np.abs(p[..., 0]) - apart) ** 2 + (p[..., 1:] ** 2).sum(-1) < 0.45**2


def thick_l(rng):
    """Two bars that meet at a right angle, of more voxels than `l`."""
    wide = rng.uniform(0.35, 0.45)

    def inside(p):
        q = p / 0.68
        is_bar = np.minimum(q[..., 0], q[..., 1]) < 2 * wide - 1
        return is_bar & (np.abs(q[..., :2]).max(-1) < 1) & (np.abs(q[..., 2]) < wide)

    return inside


def dent(rng):
    """A lobed ball with a piece of another ball missing."""
    body, (d,), reach = lobed(rng, 6, -0.08, 0.12, 3), directions(rng, 1), rng.uniform(0.2, 0.4)
    return lambda p: body(p) & (((p - 0.8 * d) ** 2).sum(-1) > reach**2)


def stars(rng):
    """A slab whose outline has 3 to 8 arms."""
    n, arm, thick = rng.integers(3, 9), rng.uniform(0.15, 0.38), rng.uniform(0.15, 0.4)

    def inside(p):
        outline = 0.9 - arm + arm * np.cos(n * np.arctan2(p[..., 1], p[..., 0]))
        return (np.hypot(p[..., 0], p[..., 1]) < outline) & (np.abs(p[..., 2]) < thick)

    return inside


def slab(rng):
    """A box with a notch in a side."""
    half, wide, deep, at = (rng.uniform(*r) for r in ((0.22, 0.45), (0.07, 0.22), (0.1, 0.45), (-0.35, 0.35)))

    def inside(p):
        is_box = (np.abs(p) < (0.68, 0.54, half)).all(-1)
        return is_box & ~((np.abs(p[..., 0] - at) < wide) & (p[..., 1] > 0.54 - deep))

    return inside


def cross(rng):
    """Three bars through the centre, at right angles."""
    a, b, c = rng.uniform(0.15, 0.3, 3)

    def inside(p):
        x, y, z = (np.abs(p[..., k]) for k in range(3))
        return ((x < 0.8) & (y < a) & (z < b)) | ((y < 0.8) & (x < b) & (z < c)) | ((z < 0.8) & (x < c) & (y < a))

    return inside


def wedge(rng):
    """A disc with a sector missing."""
    gap, thick = rng.uniform(0.15, 0.6), rng.uniform(0.2, 0.4)

    def inside(p):
        is_disc = (np.hypot(p[..., 0], p[..., 1]) < 0.85) & (np.abs(p[..., 2]) < thick)
        return is_disc & (np.abs(np.arctan2(p[..., 1], p[..., 0])) > gap)

    return inside


def mushroom(rng):
    """A part of a ball on a stem."""
    cut, stem = rng.uniform(0.1, 0.3), rng.uniform(0.18, 0.35)

    def inside(p):
        is_cap = ((p**2).sum(-1) < 0.8**2) & (p[..., 2] > cut)
        return is_cap | ((np.hypot(p[..., 0], p[..., 1]) < stem) & (p[..., 2] > -0.75) & (p[..., 2] < 0.5))

    return inside


def helix(rng):
    """A tube around more than one turn of a helix, wider than that of `spiral`."""
    a = 2 * np.pi * rng.uniform(1.3, 1.8) * np.linspace(0, 1, 800)
    return tube(np.stack([0.52 * np.cos(a), 0.52 * np.sin(a), np.linspace(-0.57, 0.57, 800)], axis=1), 0.2)


def cup(rng):
    """A part of a hollow ball."""
    inner, rim = rng.uniform(0.5, 0.6), rng.uniform(0.1, 0.4)

    def inside(p):
        square = (p**2).sum(-1)
        return (square < 0.85**2) & (square > inner**2) & (p[..., 2] < rim)

    return inside


def knot(rng):
    """A tube around a trefoil."""
    a = np.linspace(0, 2 * np.pi, 800)
    path = [np.sin(a) + 2 * np.sin(2 * a), np.cos(a) - 2 * np.cos(2 * a), -np.sin(3 * a)]
    return tube(0.26 * np.stack(path, axis=1), rng.uniform(0.13, 0.16))


def bumps(rng):
    """An ellipsoid with bumps."""
    return lobed(rng, 12, 0, 0.2, 12, rng.uniform(0.5, 1, 3))


def potato(rng):
    """A ball with bumps and dents."""
    return lobed(rng, 20, -0.12, 0.12, 6)


SOLIDS = {
    **WITH_TRUTH,
    **{
        name: lambda rng, make=make: Solid(make(rng), None, None)
        for name, make in {
            "thick-l": thick_l, "two-lobes": two_lobes, "dent": dent, "stars": stars, "slab": slab, "cross": cross,
            "wedge": wedge, "mushroom": mushroom, "bumps": bumps, "potato": potato, "helix": helix, "cup": cup,
            "knot": knot,
        }.items()
    },
}  # fmt: skip
NAMES = (
    "starfish", "l", "thick-l", "two-lobes", "dent", "stars", "slab", "cross", "wedge", "mushroom", "bean", "bumps",
    "potato", "dumbbell", "sheet", "torus", "spiral", "helix", "cup", "knot", "c",
)  # fmt: skip


def image_of(name, size, n_objects, seed):
    """Objects one behind the other, with a layer of nothing around each."""
    image = np.zeros((n_objects * (size + 2), size + 2, size + 2), np.int32)
    for k in range(n_objects):
        rng = np.random.default_rng([seed, size, k])
        part = image[k * (size + 2) + 1 :][:size, 1:-1, 1:-1]
        part[voxels(SOLIDS[name](rng), size, rng)] = k + 1
    return image


def row_of(name, args):
    """Rate, V* and certificates of a family."""
    image = image_of(name, args.size, args.objects, args.seed)
    seconds = []
    for _ in range(args.rounds):
        begin = time.process_time()
        stars = label_stars(image, spacing=(1, 1, 1))
        seconds.append(time.process_time() - begin)
    return {
        "family": name, "size": args.size, "seed": args.seed, "objects": len(stars.voxels),
        "cpu_seconds": [round(s, 5) for s in seconds], "objects_a_second": round(len(stars.voxels) / min(seconds), 1),
        "voxels": [int(stars.voxels.min()), int(stars.voxels.max())],
        "visible": [float(stars.visible.min()), float(stars.visible.max())], "visible_sum": float(stars.visible.sum()),
        "certified": float(stars.is_certified.mean()),
    }  # fmt: skip


def main():
    """Print rows as they come and write them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--size", type=int, default=40, help="edge of an object's cube in voxels (default 40)")
    parser.add_argument("--objects", type=int, default=20, help="of each family (default 20)")
    parser.add_argument("--seed", type=int, default=57)
    parser.add_argument("--rounds", type=int, default=2, help="of which the least counts (default 2)")
    parser.add_argument("--families", default=",".join(NAMES), metavar="A,B,...", help=f"some of {', '.join(SOLIDS)}")
    parser.add_argument("--json")
    args = parser.parse_args()
    names = args.families.split(",")
    unknown = [name for name in names if name not in SOLIDS]
    if unknown:
        parser.error(f"--families must be some of {', '.join(SOLIDS)}; got '{unknown[0]}'")
    rows = []
    print(f"| {args.size}^3 | objects a second | V* | certified |\n|---|---|---|---|")
    for name in names:
        row = row_of(name, args)
        rows.append(row)
        low, high = row["visible"]
        rate = f"{row['objects_a_second']:,.0f}"
        print(f"| {name} | {rate} | {low:.3f} to {high:.3f} | {row['certified']:.0%} |", flush=True)
        if args.json:
            Path(args.json).write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
