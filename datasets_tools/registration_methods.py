"""Ways to register a pair: through kernels, and what else Open3D offers, with the parameters used."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

from registration_pairs import Pair, motion


class Found(NamedTuple):
    """A start, an end, and what a method says of its own answer."""

    first: Any
    final: Any
    ambiguous: bool = False
    led_by: str = ""
    verdict: str = ""
    probability: float = float("nan")
    evidence: dict[str, float] = {}  # noqa: RUF012


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


def start_ransac(source: Any, target: Any, extent: float, cells: int = 50) -> Any:
    """FPFH + RANSAC: voxel 1/50 of the diagonal, 3 points, 1.5 voxels, edge check 0.9, 100,000 trials, 0.999."""
    import open3d

    pipeline, voxel = open3d.pipelines.registration, extent / cells
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


def peer(start: Callable[[Any, Any, float], Any]) -> Callable[[Pair], Found]:
    """Finish a start with the ICP all others share."""

    def run(pair: Pair) -> Found:
        import numpy as np
        import open3d

        open3d.utility.random.seed(pair.number)
        source, target = cloud_of(pair.source), cloud_of(pair.target)
        extent = float(np.linalg.norm(np.ptp(pair.source[0], axis=0)))
        first = np.array(start(source, target, extent))
        return Found(first, final_icp(source, target, first, extent))

    return run


def start_kiss(source: Any, target: Any, extent: float, cells: int = 50) -> Any:
    """KISS-Matcher with a voxel of 1/50 of the diagonal and the rest as it comes."""
    import numpy as np

    return kiss_motion(np.asarray(source.points), np.asarray(target.points), extent / cells)


def kiss_motion(source: Any, target: Any, voxel: float) -> Any:
    """The motion that KISS-Matcher finds between two arrays of points."""
    import kiss_matcher
    import numpy as np

    matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(voxel))
    found = matcher.estimate(source.astype(np.float32), target.astype(np.float32))
    return motion(np.array(found.rotation), np.array(found.translation).ravel())


def kiss_and_gicp(pair: Pair) -> Found:
    """KISS-Matcher, then `small_gicp` with clouds thinned to 1/200 of the diagonal and a reach of 1/60; no normals."""
    import numpy as np
    import small_gicp

    extent = float(np.linalg.norm(np.ptp(pair.source[0], axis=0)))
    first = kiss_motion(pair.source[0], pair.target[0], extent / 50)
    end = small_gicp.align(
        pair.target[0], pair.source[0], init_T_target_source=first, registration_type="GICP",
        downsampling_resolution=extent / 200, max_correspondence_distance=extent / 60, num_threads=1,
    )  # fmt: skip
    return Found(first, np.array(end.T_target_source))


def by_register(**options: Any) -> Callable[[Pair], Found]:
    """Run `voxkernel.register`."""

    def run(pair: Pair) -> Found:
        import voxkernel

        found = voxkernel.register(pair.source, pair.target, **options)
        return Found(
            found.kernel_T_target_source, found.T_target_source, found.ambiguous, found.led_by, found.verdict,
            found.probability, dict(found.evidence),
        )  # fmt: skip

    return run


METHODS: dict[str, tuple[str, Callable[[Pair], Found]]] = {
    "kernels": ("register", by_register()),
    "overlap": ("register, overlap_steps=1", by_register(overlap_steps=1)),
    "ransac": ("FPFH + RANSAC", peer(start_ransac)),
    "ransac35": ("FPFH + RANSAC, voxel 1/35", peer(partial(start_ransac, cells=35))),
    "ransac75": ("FPFH + RANSAC, voxel 1/75", peer(partial(start_ransac, cells=75))),
    "kiss": ("KISS-Matcher", peer(start_kiss)),
    "kiss35": ("KISS-Matcher, voxel 1/35", peer(partial(start_kiss, cells=35))),
    "kiss75": ("KISS-Matcher, voxel 1/75", peer(partial(start_kiss, cells=75))),
    "kissgicp": ("KISS-Matcher + GICP", kiss_and_gicp),
    "fgr": ("FPFH + FGR", peer(start_fast_global)),
    "pca": ("PCA + ICP", peer(start_pca)),
    "icp": ("ICP", peer(start_nothing)),
}
