"""What is computed for one mesh: rows of the table, and the pictures that go with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._plain import plain
from voxkernel.errors import MeshError
from voxkernel.evaluation.settings import EvaluateSettings
from voxkernel.halfspaces.surface_arguments import SurfaceArgument, surface_argument
from voxkernel.labels import is_label_file
from voxkernel.measures import Starshapeness, defect_profile, starshapeness
from voxkernel.measures.defect_profile import profile_of_planes
from voxkernel.measures.starshapeness import score_of_planes
from voxkernel.mesh import MeshFacts, TriangleMesh, as_mesh
from voxkernel.relaxed.facet_weights import weigh

__all__ = ["Analysis", "analyse", "warm_up"]

_SOLIDS = (".hedra", ".mesh", ".vtu")


@dataclass(frozen=True, slots=True)
class Analysis:
    """Rows of one mesh (one, or one per cell) and the content of the files they name."""

    rows: tuple[Mapping[str, Any], ...]
    files: Mapping[str, bytes] = field(default_factory=dict[str, bytes])


def analyse(
    path: str, settings: EvaluateSettings, *, name: str, view: bool = False, ids: NDArray[np.int64] | None = None,
    rows: Sequence[Mapping[str, Any]] = (),
) -> Analysis:  # fmt: skip
    """Compute the row of a surface, or one row per cell of a polyhedral mesh or per object of a label image.

    Parameters
    ----------
    path : str
        A local file, or a folder of cells.
    settings : EvaluateSettings
        What to compute.
    name : str
        Of the picture files, without folder and suffix.
    view : bool
        Whether to simplify the surface for an interactive view.
    ids : array of int, optional
        Of a label image: the objects to look at; their pictures are drawn later. All by default, with pictures.
    rows : sequence of dict, optional
        Of a label image: rows of objects, to be drawn.

    Returns
    -------
    Analysis
        Columns of the table but for those that name the run.
    """
    if is_label_file(path):
        from voxkernel.evaluation.label_rows import drawn_rows, label_rows

        if rows:
            return Analysis(*drawn_rows(path, settings, name=name, rows=rows))
        return Analysis(*label_rows(path, settings, name=name, ids=ids))
    cells = _cells_of(path)
    if cells is not None:
        return cells
    clock = _Clock()
    mesh = as_mesh(path)
    threads = settings.threads
    row: dict[str, Any] = {"kind": "surface", **_of_facts(mesh.facts())}
    row["seconds_read"] = clock.lap()
    planes = surface_argument(mesh, threads=threads)  # once, for all that follows
    score = score_of_planes(mesh, planes, settings.domain, settings.gap, threads=threads)
    row |= _of_score(score)
    row["certificate_verified"] = score.certificate.verify()
    row["seconds_exact"] = clock.lap()
    row |= _relaxed(mesh, planes, score, settings)
    row["seconds_relaxed"] = clock.lap()
    files: dict[str, bytes] = {}
    if settings.thumbnails is not False or view:
        from voxkernel.evaluation.row_pictures import pictures

        try:
            files = pictures(mesh, score, settings, name=name, view=view)
        except Exception as error:  # a drawing library that fails must not cost the numbers
            row["notes"].append(f"no pictures: {type(error).__name__}: {error}")
        row["seconds_pictures"] = clock.lap()
    for column, folder in (("thumbnail", "thumbnails/"), ("view", "views/")):
        row[column] = next((file for file in files if file.startswith(folder)), "")
    return Analysis((row,), files)


def warm_up() -> None:
    """Load or compile every loop that rows need, so that no mesh is charged for it."""
    tetrahedron = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    apart = np.concatenate([tetrahedron, tetrahedron + 3.0]), np.concatenate([faces, faces + 4])
    for surface in ((tetrahedron, faces), (tetrahedron, faces[1:]), apart):
        mesh = as_mesh(surface)
        mesh.facts()
        score = starshapeness(mesh)
        score.certificate.verify()
        defect_profile(mesh, tolerances=[0.1], depth=3)


class _Clock:
    """Wall-clock time of each stage."""

    def __init__(self) -> None:
        self._last = perf_counter()

    def lap(self) -> float:
        """Give the seconds since the last call."""
        before, self._last = self._last, perf_counter()
        return self._last - before


def _of_facts(facts: MeshFacts) -> dict[str, Any]:
    same = (
        "n_vertices", "n_faces", "n_facets", "n_components", "n_boundary_edges", "n_nonmanifold_edges", "genus",
        "is_closed", "is_oriented", "is_outward",
    )  # fmt: skip
    return {
        **{name: getattr(facts, name) for name in same},
        "n_degenerate": len(facts.degenerate_facets),
        "area": plain(facts.area),
        "enclosed_volume": plain(facts.volume),
        "diagonal": plain(facts.diagonal),
    }


def _of_score(score: Starshapeness) -> dict[str, Any]:
    domain = score.kernel.domain
    center = (None, None, None) if score.center is None else tuple(score.center.tolist())
    return {
        "verdict": score.verdict,
        "verdict_reason": score.reason,
        "dimension": score.dimension,
        "ratio": plain(score.ratio),
        "volume": plain(score.volume),
        "volume_lower": plain(score.volume_bounds[0]),
        "volume_upper": plain(score.volume_bounds[1]),
        "reference": score.reference,
        "reference_volume": plain(score.reference_volume),
        "clearance": plain(score.clearance),
        "domain": None if domain is None else domain.kind,
        "cut_by_domain": score.kernel.cut_by_domain,
        **dict(zip(("center_x", "center_y", "center_z"), center, strict=True)),
        "certificate_kind": score.certificate.kind,
        "certificate_facets": list(score.certificate.facet_ids),
        "notes": list(score.notes),
        "violation_lower": score.violation_bounds[0],
        "violation_upper": score.violation_bounds[1],
        **dict(zip(("star_center_x", "star_center_y", "star_center_z"), score.star_center.tolist(), strict=True)),
    }


def _relaxed(
    mesh: TriangleMesh, planes: SurfaceArgument, score: Starshapeness, settings: EvaluateSettings
) -> dict[str, Any]:
    """Measure the defect profile, and what else was asked for, about the star centre."""
    profile = profile_of_planes(
        weigh(planes.halfspaces), planes, planes.bounded_domain(settings.domain), np.array(settings.tolerances),
        settings.depth, settings.threads,
    )  # fmt: skip
    row: dict[str, Any] = {
        "profile_tolerances": profile.tolerances.tolist(),
        "profile_shares": profile.volume_share.tolist(),
    }
    if settings.visible:
        from voxkernel.measures import visible_fraction

        seen = visible_fraction(mesh, score.star_center)
        row |= {"visible_fraction": seen.fraction}
        row |= {"visible_lower": seen.bounds[0], "visible_upper": seen.bounds[1]}
    if settings.guards is not None:
        row |= _guarded(mesh, settings.guards, settings.threads)
    if settings.energies is not None:
        from voxkernel.spherical import spherical_map

        seen_from = spherical_map(mesh, center=score.star_center)
        row["energies"] = plain(seen_from.harmonics(settings.energies).energies)
    return row


def _guarded(mesh: TriangleMesh, coverage: float, threads: int) -> dict[str, Any]:
    """Count the guards; a surface without an inner side has none, and a reason."""
    from voxkernel.guarding import guards

    try:
        found = guards(mesh, coverage=coverage, threads=threads)
    except MeshError as error:
        return {"guards_reason": str(error)}
    return {
        "guards": len(found), "guards_seen": found.seen, "guards_certified": found.certified,
        "guards_reason": found.reason,
    }  # fmt: skip


def _cells_of(path: str) -> Analysis | None:
    """Give one row per cell of a polyhedral mesh; None for surfaces."""
    import os

    if not path.lower().endswith(_SOLIDS) and not os.path.isdir(path):
        return None
    from voxkernel.polyhedral import cell_kernels, is_polyhedral, read_polyhedral

    if not is_polyhedral(path):
        return None
    clock = _Clock()
    mesh = read_polyhedral(path)
    seconds_read = clock.lap()
    kernels = cell_kernels(mesh)
    seconds_exact = clock.lap()
    rows = kernels.to_rows()
    for row, volume, diameter in zip(rows, kernels.volume.tolist(), kernels.diameter.tolist(), strict=True):
        row |= {
            "kind": "cell",
            "enclosed_volume": plain(volume),
            "diagonal": plain(diameter),
            "seconds_read": seconds_read / len(rows),
            "seconds_exact": seconds_exact / len(rows),
            "thumbnail": "",
            "view": "",
        }
    return Analysis(tuple(rows))
