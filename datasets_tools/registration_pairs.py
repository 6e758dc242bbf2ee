"""Pairs of surfaces whose rigid motion is known: scans, noisy, decimated and cropped copies, closed meshes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

CLOSED = (
    "cinolib_blub_triangulated", "cinolib_cactus", "common3d_cheburashka", "common3d_cow", "common3d_homer",
    "common3d_rocker-arm", "common3d_spot", "gc_fox", "gpytoolbox_teddy", "pmp_bunny_adaptive",
)  # fmt: skip
OTHER = {"neutral": "smile", "smile": "mouthopen", "mouthopen": "neutral"}


@dataclass(frozen=True)
class Pair:
    """Source and target as (vertices, faces), and the true motion from source to target."""

    row: str
    number: int
    source: tuple[Any, Any]
    target: tuple[Any, Any]
    T_target_source: Any


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


def scan_pairs(data: Path, count: int, first: int = 0) -> Iterator[Pair]:
    """Pairs of the scans with their references, changed in every way, and of faces that differ.

    Poses, noise and crops follow the numbers of the pairs, which begin with `first`.
    """
    import numpy as np

    truth = json.loads((data / "scans" / "ground_truth.json").read_text())["scans"]
    for number, (name, entry) in enumerate(list(truth.items())[:count], start=first):
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


def closed_pairs(data: Path, count: int, first: int = 0) -> Iterator[Pair]:
    """Pairs of closed meshes with a remeshed copy, its vertices moved by 0.3 % of the diagonal."""
    import numpy as np

    import voxkernel

    for number, name in enumerate(CLOSED[:count], start=first):
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


def range_scans(data: Path, most: int | None, first: int = 0) -> Iterator[tuple[str, float, Pair]]:
    """Pairs of real range scans of one object, the largest overlap first; at most so many, at even steps."""
    import numpy as np

    facts = json.loads((data / "range_scans" / "ground_truth.json").read_text())
    to_common = {name: np.array(matrix) for name, matrix in facts["T_common_scan"].items()}
    known = sorted(facts["overlap"].items(), key=lambda item: -item[1])
    step = 1 if most is None else max(1, len(known) // most)
    for number, (name, overlap) in list(enumerate(known))[::step]:
        one, two = name.split("|")
        source, target = (arrays(data / "range_scans" / part) for part in (one, two))
        yield name, overlap, posed(
            f"range scans {name}", first + number, source, target, np.linalg.inv(to_common[two]) @ to_common[one]
        )
