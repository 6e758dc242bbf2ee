"""Sets of partial scans of one thing in random poses, with scans that belong to nothing among them."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# One half to tune on, the other to report on: no object is in both, but for the one of the range scans.
FACES = {
    "tune": ("ict01_neutral", "ict03_smile", "ict05_mouthopen"),
    "report": ("ict02_smile", "ict06_neutral", "ict08_mouthopen"),
}
CLOSED = {
    "tune": ("common3d_cow", "gc_fox", "common3d_homer"),
    "report": ("common3d_spot", "pmp_bunny_adaptive", "gpytoolbox_teddy"),
}
CROPPED = {
    "tune": ("common3d_cheburashka", "ict07_neutral", "cinolib_blub_triangulated"),
    "report": ("common3d_rocker-arm", "ict10_smile", "cinolib_cactus"),
}
STRANGERS = {"tune": ("trimesh_fandisk", "cinolib_soccerball"), "report": ("trimesh_quadknot", "sorgente_vase2")}
RANGE_SCANS = {
    "tune": (0, 48, 96, 144, 192, 240, 288, 24),
    "report": (312, 336, 120, 168, 216, 264, 72),
    "all": tuple(range(0, 360, 24)),
}


@dataclass(frozen=True)
class ScanSet:
    """Scans as (vertices, faces), and the true motion of each into a common frame; None for those of another thing."""

    row: str
    name: str
    scans: tuple[tuple[Any, Any], ...]
    T_common_scan: tuple[Any, ...]


def strips(surface: Any, count: int, share: float) -> list[Any]:
    """Cut a surface into strips across its longest direction, each with a share of the area."""
    import numpy as np

    vertices, faces = surface
    middles, areas = _middles_and_areas(surface)
    axis = np.linalg.eigh(np.cov(middles.T))[1][:, 2]
    order = np.argsort(middles @ axis)
    at = np.empty(len(faces))
    at[order] = np.cumsum(areas[order]) / areas.sum()
    starts = np.linspace(0.0, 1.0 - share, count)
    return [(vertices, faces[(at >= s) & (at <= s + share)]) for s in starts]


def views(surface: Any, count: int, rng: Any) -> list[Any]:
    """What scanners all around a surface see of it: the facets that face them and that nothing hides."""
    import numpy as np
    import open3d

    vertices, faces = surface
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
    middles = corners.mean(axis=1)
    extent = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))
    turns = np.arange(count) * 2.0 * np.pi / count + rng.uniform(0.0, 2.0 * np.pi)
    tilts = rng.uniform(-0.3, 0.3, count)
    found: list[Any] = []
    for turn, tilt in zip(turns, tilts, strict=True):
        towards = np.array([np.cos(turn) * np.cos(tilt), np.sin(tilt), np.sin(turn) * np.cos(tilt)])
        starts = middles + 1e-4 * extent * normals
        rays = np.hstack([starts, np.broadcast_to(towards, starts.shape)]).astype(np.float32)
        free = ~np.isfinite(scene.cast_rays(open3d.core.Tensor(rays))["t_hit"].numpy())
        found.append((vertices, faces[free & (normals @ towards > 0.2)]))
    return found


def crops(surface: Any, count: int, share: float, rng: Any) -> list[Any]:
    """Keep the part of a surface that is nearest to each of some points of it, far from each other."""
    import numpy as np

    vertices, faces = surface
    middles, areas = _middles_and_areas(surface)
    seeds = [int(rng.integers(len(faces)))]
    while len(seeds) < count:
        gaps = np.min([np.linalg.norm(middles - middles[s], axis=1) for s in seeds], axis=0)
        seeds.append(int(np.argmax(gaps)))
    found: list[Any] = []
    for seed in seeds:
        order = np.argsort(np.linalg.norm(middles - middles[seed], axis=1))
        found.append((vertices, faces[np.sort(order[np.cumsum(areas[order]) <= share * areas.sum()])]))
    return found


def scanned(surface: Any, extent: float, rng: Any) -> Any:
    """Give a part triangles of its own and noise of 0.1 % of the diagonal, so that no two share a vertex."""
    import numpy as np
    import open3d

    used, faces = np.unique(surface[1], return_inverse=True)
    vertices = surface[0][used] + rng.normal(size=(len(used), 3)) * 0.001 * extent
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(vertices), open3d.utility.Vector3iVector(faces.reshape(-1, 3).astype(np.int32))
    )
    thin = mesh.simplify_quadric_decimation(int(len(surface[1]) * rng.uniform(0.5, 0.75)))
    return np.asarray(thin.vertices).copy(), np.asarray(thin.triangles).astype(np.int64)


def sets(data: Path, half: str, count: int) -> Iterator[ScanSet]:
    """Make all sets of one half."""
    import numpy as np

    strangers = [_arrays(data / "closed" / f"{name}.ply") for name in STRANGERS[half]]
    rows = (
        ("strips of a face", FACES, lambda s, _: strips(s, 4, 0.4)),
        ("views of a closed body", CLOSED, lambda s, rng: views(s, 6, rng)),
        ("crops", CROPPED, lambda s, rng: crops(s, 5, 0.45, rng)),
    )
    for row_number, (row, names, cut) in enumerate(rows):
        for number, name in enumerate(names[half][:count]):
            rng = np.random.default_rng([row_number, number, len(half)])
            folder = "faces" if name.startswith("ict") else "closed"
            surface = _arrays(data / folder / f"{name}.ply")
            extent = float(np.linalg.norm(np.ptp(surface[0], axis=0)))
            parts = [scanned(part, extent, rng) for part in cut(surface, rng)]
            yield _posed(row, name, parts, [np.eye(4)] * len(parts), strangers[: 1 + number % 2], extent, rng)
    yield range_scans(data, half, strangers)


def range_scans(data: Path, half: str, strangers: list[Any]) -> ScanSet:
    """Real range scans of one object."""
    import numpy as np

    truth = json.loads((data / "range_scans" / "ground_truth.json").read_text(encoding="utf-8"))["T_common_scan"]
    names = [f"dragon_{angle}.ply" for angle in RANGE_SCANS[half]]
    parts = [_arrays(data / "range_scans" / name) for name in names]
    extent = float(np.linalg.norm(np.ptp(parts[0][0], axis=0)))
    known = [np.array(truth[name]) for name in names]
    return _posed("range scans", half, parts, known, strangers, extent, np.random.default_rng(len(half)))


def _posed(
    row: str, name: str, parts: list[Any], known: list[Any], strangers: list[Any], extent: float, rng: Any
) -> ScanSet:
    """Bring every scan into a random pose, in random order; strangers are of the size of the thing."""
    import numpy as np
    from scipy.spatial.transform import Rotation

    members: list[tuple[Any, Any]] = list(zip(parts, known, strict=True))
    for vertices, faces in strangers:
        size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
        members.append((scanned((vertices * (0.8 * extent / size), faces), extent, rng), None))
    scans: list[Any] = []
    truths: list[Any] = []
    for place in rng.permutation(len(members)):
        (vertices, faces), T_common_part = members[place]
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3) * extent
        scans.append((vertices @ pose[:3, :3].T + pose[:3, 3], faces))
        truths.append(None if T_common_part is None else T_common_part @ np.linalg.inv(pose))
    return ScanSet(row, name, tuple(scans), tuple(truths))


def _middles_and_areas(surface: Any) -> tuple[Any, Any]:
    import numpy as np

    corners = surface[0][surface[1]]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return corners.mean(axis=1), 0.5 * np.linalg.norm(normals, axis=1)


def _arrays(path: Path) -> Any:
    import voxkernel

    mesh = voxkernel.as_mesh(path)
    return mesh.vertices, mesh.faces
