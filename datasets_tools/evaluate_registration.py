"""Success rates of registration through kernels beside FPFH + RANSAC, fast global registration, PCA and ICP.

Every pair is a surface and a changed copy of it (or another scan of the same object) in a random pose; the
true motion is known. A registration succeeds when it is within 2 degrees and 1 % of the diagonal of it. All
methods run in the same process on the same pairs, and all but ours end in the same ICP.

The data are folders as described in their README: `scans/` with `ground_truth.json`, `faces/` and `closed/`.
Without them, pairs are made from a face by formula.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

EXAMPLES = """examples:
  python datasets_tools/evaluate_registration.py --data data -o registration.md --json registration.json
  python datasets_tools/evaluate_registration.py --pairs 2 --methods kernels ransac
"""
SUCCESS_DEG, SUCCESS_SHARE = 2.0, 0.01
CLOSED = (
    "cinolib_blub_triangulated", "cinolib_cactus", "common3d_cheburashka", "common3d_cow", "common3d_homer",
    "common3d_rocker-arm", "common3d_spot", "gc_fox", "gpytoolbox_teddy", "pmp_bunny_adaptive",
)  # fmt: skip
OTHER = {"neutral": "smile", "smile": "mouthopen", "mouthopen": "neutral"}


@dataclass(frozen=True)
class Outcome:
    """What one method made of one pair; errors in degrees and in shares of the source's diagonal."""

    row: str
    pair: int
    method: str
    start_deg: float
    start_share: float
    final_deg: float
    final_share: float
    seconds: float
    ambiguous: bool = False
    led_by: str = ""

    @property
    def success(self) -> bool:
        """Whether the final motion is close enough to the true one."""
        return self.final_deg < SUCCESS_DEG and self.final_share < SUCCESS_SHARE


@dataclass(frozen=True)
class Pair:
    """Source and target as (vertices, faces), and the true motion from source to target."""

    row: str
    number: int
    source: tuple[Any, Any]
    target: tuple[Any, Any]
    T_target_source: Any


# ---------------------------------------------------------------------------------------------- pairs


def motion(rotation: Any, shift: Any) -> Any:
    """Make a 4x4 matrix."""
    import numpy as np

    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, shift
    return matrix


def posed(row: str, number: int, source: Any, surface: Any, known: Any) -> Pair:
    """Bring a surface into a random pose, another one for every pair of every row."""
    from zlib import crc32

    import numpy as np
    from scipy.spatial.transform import Rotation

    rng = np.random.default_rng([crc32(row.encode()), number])
    extent = np.linalg.norm(np.ptp(surface[0], axis=0))
    pose = motion(Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3) * extent)
    return Pair(row, number, source, (surface[0] @ pose[:3, :3].T + pose[:3, 3], surface[1]), pose @ known)


def noisy(surface: Any, sigma: float, seed: int) -> Any:
    """Move every vertex by normal noise, the same in all directions."""
    import numpy as np

    return surface[0] + np.random.default_rng([11, seed]).normal(size=surface[0].shape) * sigma, surface[1]


def decimated(surface: Any, facets: int) -> Any:
    """Decimate by quadrics (PyMeshLab)."""
    import voxkernel

    mesh = voxkernel.repair(surface, decimate_to=facets).mesh
    return mesh.vertices, mesh.faces


def cropped(surface: Any, share: float, seed: int) -> Any:
    """Cut a share of the area away on one side, in a random direction across the surface."""
    import numpy as np

    vertices, faces = surface
    corners = vertices[faces]
    middles = corners.mean(axis=1)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    _, axes = np.linalg.eigh(np.cov(middles.T))
    angle = np.random.default_rng([13, seed]).uniform(0.0, 2.0 * np.pi)
    order = np.argsort(middles @ (np.cos(angle) * axes[:, 2] + np.sin(angle) * axes[:, 1]))
    kept = order[np.cumsum(areas[order]) <= (1.0 - share) * areas.sum()]
    return vertices, faces[np.sort(kept)]


def arrays(path: Path) -> Any:
    """Read vertices and faces."""
    import voxkernel

    mesh = voxkernel.as_mesh(path)
    return mesh.vertices, mesh.faces


def scan_pairs(data: Path, count: int) -> Iterator[Pair]:
    """Pairs of the scans with their references, changed in every way, and of faces that differ."""
    import numpy as np

    truth = json.loads((data / "scans" / "ground_truth.json").read_text())["scans"]
    for number, (name, entry) in enumerate(list(truth.items())[:count]):
        source, scan = arrays(data / entry["reference"]), arrays(data / "scans" / name)
        known = np.array(entry["T_ref_to_scan"])
        yield posed("scans", number, source, scan, known)
        for sigma in (1, 2, 4):
            yield posed(f"{sigma} mm noise", number, source, noisy(scan, sigma, 10 * number + sigma), known)
        for facets in (400, 150):
            yield posed(f"{facets} facets", number, source, decimated(scan, facets), known)
        for percent in (10, 20, 30, 50, 70):
            cut = cropped(scan, percent / 100, 100 * number + percent)
            yield posed(f"{percent} % cropped", number, source, cut, known)
        person, expression = Path(entry["reference"]).stem.split("_")
        changed = arrays(data / "faces" / f"{person}_{OTHER[expression]}.ply")
        yield posed("another expression", number, source, changed, np.eye(4))
        neighbour = f"ict{int(person[3:]) % 10 + 1:02d}"
        yield posed(
            "another identity", number, source, arrays(data / "faces" / f"{neighbour}_{expression}.ply"), np.eye(4)
        )


def closed_pairs(data: Path, count: int) -> Iterator[Pair]:
    """Pairs of closed meshes with a remeshed copy, its vertices moved by 0.3 % of the diagonal."""
    import numpy as np

    import voxkernel

    for number, name in enumerate(CLOSED[:count]):
        source = arrays(data / "closed" / f"{name}.ply")
        extent = float(np.linalg.norm(np.ptp(source[0], axis=0)))
        again = voxkernel.repair(source, remesh_edge_length=extent / 60).mesh
        copy = noisy((again.vertices, again.faces), 0.003 * extent, number)
        yield posed("closed, remeshed", number, source, copy, np.eye(4))


def formula_pairs(count: int) -> Iterator[Pair]:
    """Pairs of a face by formula with noisy, decimated and cropped copies."""
    import numpy as np

    import voxkernel
    from voxkernel.demo_shapes import face

    mesh = voxkernel.as_mesh(face())
    source = (mesh.vertices, mesh.faces)
    extent = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    for number in range(count):
        yield posed("formula, 1 % noise", number, source, noisy(source, 0.01 * extent, number), np.eye(4))
        yield posed("formula, 400 facets", number, source, decimated(source, 400), np.eye(4))
        yield posed("formula, 20 % cropped", number, source, cropped(source, 0.2, number), np.eye(4))


# -------------------------------------------------------------------------------------------- methods


def cloud_of(surface: Any) -> Any:
    """Make an Open3D cloud of the vertices with the normals of the mesh."""
    import numpy as np
    import open3d

    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(np.array(surface[0])),
        open3d.utility.Vector3iVector(np.array(surface[1], dtype=np.int32)),
    )
    mesh.remove_unreferenced_vertices()
    mesh.compute_vertex_normals()
    cloud = open3d.geometry.PointCloud(mesh.vertices)
    cloud.normals = mesh.vertex_normals
    return cloud


def final_icp(source: Any, target: Any, start: Any, extent: float) -> Any:
    """Point-to-plane ICP with a reach of 1/17 and then 1/60 of the diagonal, as the others end."""
    import numpy as np
    import open3d

    pipeline = open3d.pipelines.registration
    estimate = pipeline.TransformationEstimationPointToPlane()
    limits = pipeline.ICPConvergenceCriteria(1e-7, 1e-7, 60)
    for reach in (extent / 17, extent / 60):
        start = pipeline.registration_icp(source, target, reach, start, estimate, limits).transformation
    return np.array(start)


def features(cloud: Any, voxel: float) -> Any:
    """Thin a cloud and compute its FPFH: normals of the mesh, radius of five voxels, 100 neighbours."""
    import open3d

    thin = cloud.voxel_down_sample(voxel)
    search = open3d.geometry.KDTreeSearchParamHybrid(5 * voxel, 100)
    return thin, open3d.pipelines.registration.compute_fpfh_feature(thin, search)


def start_ransac(source: Any, target: Any, extent: float) -> Any:
    """FPFH + RANSAC: voxel 1/50 of the diagonal, 3 points, 1.5 voxels, edge check 0.9, 100,000 trials, 0.999."""
    import open3d

    pipeline, voxel = open3d.pipelines.registration, extent / 50
    one, two = features(source, voxel), features(target, voxel)
    checks = [
        pipeline.CorrespondenceCheckerBasedOnEdgeLength(0.9),
        pipeline.CorrespondenceCheckerBasedOnDistance(1.5 * voxel),
    ]
    return pipeline.registration_ransac_based_on_feature_matching(
        one[0], two[0], one[1], two[1], True, 1.5 * voxel, pipeline.TransformationEstimationPointToPoint(False), 3,
        checks, pipeline.RANSACConvergenceCriteria(100_000, 0.999),
    ).transformation  # fmt: skip


def start_fast_global(source: Any, target: Any, extent: float) -> Any:
    """FPFH + fast global registration, the same features, pairs within 1.5 voxels."""
    import open3d

    pipeline, voxel = open3d.pipelines.registration, extent / 50
    one, two = features(source, voxel), features(target, voxel)
    option = pipeline.FastGlobalRegistrationOption(maximum_correspondence_distance=1.5 * voxel)
    return pipeline.registration_fgr_based_on_feature_matching(one[0], two[0], one[1], two[1], option).transformation


def start_pca(source: Any, target: Any, extent: float) -> Any:
    """Principal axes of the vertices; of the four proper choices of signs the one with the best fitness."""
    import numpy as np
    import open3d

    evaluate = open3d.pipelines.registration.evaluate_registration
    frames = []
    for cloud in (source, target):
        points = np.asarray(cloud.points)
        _, axes = np.linalg.eigh(np.cov(points.T))
        axes[:, 0] *= np.linalg.det(axes)
        frames.append((points.mean(axis=0), axes))
    best = None
    for signs in ((1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)):
        turn = frames[1][1] @ np.diag(np.array(signs, float)) @ frames[0][1].T
        start = motion(turn, frames[1][0] - turn @ frames[0][0])
        found = evaluate(source, target, extent / 17, start)
        key = (found.fitness, -found.inlier_rmse)
        if best is None or key > best[0]:
            best = key, start
    return best[1]


def start_nothing(source: Any, target: Any, extent: float) -> Any:
    """Put the centres of the vertices on each other."""
    import numpy as np

    return motion(np.eye(3), np.asarray(target.points).mean(axis=0) - np.asarray(source.points).mean(axis=0))


def peer(start: Callable[[Any, Any, float], Any]) -> Callable[[Pair], tuple[Any, Any, bool, str]]:
    """Finish a start with the ICP all others share."""

    def run(pair: Pair) -> tuple[Any, Any, bool, str]:
        import numpy as np
        import open3d

        open3d.utility.random.seed(pair.number)
        source, target = cloud_of(pair.source), cloud_of(pair.target)
        extent = float(np.linalg.norm(np.ptp(pair.source[0], axis=0)))
        first = np.array(start(source, target, extent))
        return first, final_icp(source, target, first, extent), False, ""

    return run


def led_by(found: Any) -> str:
    """Say whether a guess of the kernels led to the answer, or one of the net of rotations about them."""
    return "kernels" if found.margin == found.margin else "net"


def by_kernels(pair: Pair) -> tuple[Any, Any, bool, str]:
    """Run `voxkernel.register` with its defaults."""
    import voxkernel

    found = voxkernel.register(pair.source, pair.target)
    return found.kernel_T_target_source, found.T_target_source, found.ambiguous, led_by(found)


def by_overlap(pair: Pair) -> tuple[Any, Any, bool, str]:
    """Run `voxkernel.register` and once more with the kernels of what overlaps."""
    import voxkernel

    found = voxkernel.register(pair.source, pair.target, overlap_steps=1)
    return found.kernel_T_target_source, found.T_target_source, found.ambiguous, led_by(found)


METHODS: dict[str, tuple[str, Callable[[Pair], tuple[Any, Any, bool, str]]]] = {
    "kernels": ("kernels", by_kernels),
    "overlap": ("kernels of the overlap", by_overlap),
    "ransac": ("FPFH + RANSAC", peer(start_ransac)),
    "fgr": ("FPFH + FGR", peer(start_fast_global)),
    "pca": ("PCA + ICP", peer(start_pca)),
    "icp": ("ICP", peer(start_nothing)),
}


# -------------------------------------------------------------------------------------------- measure


def errors(found: Any, pair: Pair) -> tuple[float, float]:
    """Angle to the true rotation, and how far the source's centre is off, as a share of its diagonal."""
    import numpy as np

    from voxkernel._register_search import rotation_angle_deg

    centre = pair.source[0].mean(axis=0)
    off = (found - pair.T_target_source)[:3] @ np.append(centre, 1.0)
    extent = np.linalg.norm(np.ptp(pair.source[0], axis=0))
    return rotation_angle_deg(found, pair.T_target_source), float(np.linalg.norm(off) / extent)


def measure(pairs: Iterator[Pair], methods: list[str], *, report: Callable[[str], None]) -> list[Outcome]:
    """Run all methods on every pair."""
    outcomes: list[Outcome] = []
    for pair in pairs:
        for name in methods:
            began = time.perf_counter()
            first, final, ambiguous, led = METHODS[name][1](pair)
            seconds = time.perf_counter() - began
            off = *errors(first, pair), *errors(final, pair)
            outcomes.append(Outcome(pair.row, pair.number, name, *off, seconds, ambiguous, led))
        done = ", ".join(f"{o.method} {o.final_deg:.2f}" for o in outcomes[-len(methods) :])
        report(f"{pair.row} {pair.number}: degrees {done}")
    return outcomes


def table(outcomes: list[Outcome], methods: list[str]) -> str:
    """Write one line per row: successes, within 3 degrees, median start and end, seconds of every method."""
    import numpy as np

    lines = [
        "| pairs | " + " | ".join(METHODS[m][0] for m in methods) + " |",
        "|---|" + "---|" * len(methods),
    ]
    rows = list(dict.fromkeys(o.row for o in outcomes))
    for row in [*rows, "all"]:
        cells = []
        for method in methods:
            mine = [o for o in outcomes if o.method == method and row in (o.row, "all")]
            start, final = (np.median([getattr(o, k) for o in mine]) for k in ("start_deg", "final_deg"))
            near = sum(o.final_deg < 3.0 for o in mine)
            cells.append(
                f"**{sum(o.success for o in mine)}** of {len(mine)}, {near} < 3°; "
                f"{start:.1f}° → {final:.2f}°; {np.median([o.seconds for o in mine]):.2f} s"
            )
        lines.append(f"| {row} | " + " | ".join(cells) + " |")
    led = [o.led_by for o in outcomes if o.method == "kernels"]
    if led:
        lines += ["", f"Guesses of the kernels led to {led.count('kernels')} of {len(led)} answers."]
    return "\n".join(lines) + "\n"


def main(argv: list[str] | None = None) -> int:
    """Parse, measure, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, help="folder with scans/, faces/ and closed/")
    parser.add_argument("--pairs", type=int, default=10, metavar="N", help="pairs in every row; 10 by default")
    parser.add_argument("--methods", nargs="+", choices=tuple(METHODS), default=list(METHODS))
    parser.add_argument("-o", "--output", type=Path, metavar="TABLE.md")
    parser.add_argument("--json", type=Path, metavar="RAW.json", help="every outcome")
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress")
    args = parser.parse_args(argv)
    if args.pairs < 1:
        parser.error(f"`--pairs` must be at least 1; got {args.pairs}")
    if args.data is not None and not (args.data / "scans" / "ground_truth.json").exists():
        parser.error(f"`--data` must hold scans/ground_truth.json; got {args.data}")

    def report(text: str) -> None:
        if not args.quiet:
            print(text, file=sys.stderr, flush=True)

    report("warming up: compiled loops, Open3D")
    for name in args.methods:
        METHODS[name][1](next(formula_pairs(1)))
    if args.data is None:
        outcomes = measure(formula_pairs(args.pairs), args.methods, report=report)
    else:
        outcomes = measure(scan_pairs(args.data, args.pairs), args.methods, report=report)
        outcomes += measure(closed_pairs(args.data, args.pairs), args.methods, report=report)
    order = {name: k for k, name in enumerate(dict.fromkeys(o.row for o in outcomes))}
    outcomes.sort(key=lambda o: order[o.row])
    text = table(outcomes, args.methods)
    print(text, end="")
    if args.output is not None:
        args.output.write_text(text, encoding="utf-8")
    if args.json is not None:
        args.json.write_text(json.dumps([asdict(o) for o in outcomes], indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
