"""What a user should know of a surface before believing its numbers: it runs through itself, has several bodies, ..."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.errors import MissingExtraError
from voxkernel.mesh.connected_components import components
from voxkernel.mesh.triangle_mesh import TriangleMesh

__all__ = ["count_self_intersections", "surface_notes"]

_MOST_TRIANGLES = 250_000  # that are looked at for others they run through: some 2 s, which nothing can end early
_MOST_BODIES = 64  # of which every pair is looked at
_TURN = 4.0 * np.pi


def count_self_intersections(mesh: TriangleMesh) -> int | None:
    """Count the triangles that run through another one, by PyMeshLab; None where that is not installed.

    Parameters
    ----------
    mesh : TriangleMesh
        Any surface.

    Returns
    -------
    int or None
        Triangles that share an edge or a corner do not count as running through each other there.
    """
    try:
        pymeshlab = optional("pymeshlab")
    except MissingExtraError:
        return None
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(np.array(mesh.vertices), np.array(mesh.faces)))
    meshes.compute_selection_by_self_intersections_per_face()
    return int(meshes.current_mesh().selected_face_number())


def surface_notes(mesh: TriangleMesh) -> tuple[str, ...]:
    """Say what may spoil the numbers of a surface; nothing of most.

    Parameters
    ----------
    mesh : TriangleMesh
        Any surface.

    Returns
    -------
    tuple of str
        One line each: triangles that run through others (counted by PyMeshLab; left out without it, not looked for
        in surfaces of more than 250,000 triangles), several bodies, bodies inside others whose volume counts twice,
        facets that point inwards or disagree.
    """
    facts = mesh.facts()
    notes: list[str] = []
    is_large = len(mesh.faces) > _MOST_TRIANGLES
    crossing = None if is_large else count_self_intersections(mesh)
    if is_large:
        notes.append(f"not looked at whether it runs through itself: {len(mesh.faces):,} triangles are too many")
    if crossing:
        twice = ": where it overlaps, its volume counts twice" if facts.is_closed else ""
        notes.append(f"the surface runs through itself: {crossing} of {len(mesh.faces)} triangles cross others{twice}")
    if facts.n_components > 1:
        notes.append(f"{facts.n_components} bodies: the kernel is that of all of them together")
        if facts.is_closed and facts.is_oriented and not crossing and facts.n_components <= _MOST_BODIES:
            inside = _n_nested(mesh)
            if inside:
                notes.append(f"{inside} inside others, facing outwards as well: their volume counts twice")
    if not facts.is_oriented:
        notes.append("neighbouring facets disagree on which side is out; repair(mesh, orient=True) turns them")
    elif facts.is_closed and facts.volume < 0.0:
        notes.append("inside out: facets point inwards; repair(mesh, orient=True) turns them")
    return tuple(notes)


def _n_nested(mesh: TriangleMesh) -> int:
    """Closed bodies of positive volume that lie inside others of positive volume."""
    faces = mesh.faces
    rows = np.concatenate([faces[:, 0], faces[:, 0]])
    labels = components(len(mesh.vertices), rows, np.concatenate([faces[:, 1], faces[:, 2]]))[1][faces[:, 0]]
    local = (mesh.vertices - mesh.bounds.mean(axis=0)) / max(mesh.facts().diagonal, np.finfo(float).tiny)
    bodies = [local[faces[labels == label]] for label in np.unique(labels)]
    solid = [b for b in bodies if float(np.einsum("ij,ij->", b[:, 0], np.cross(b[:, 1], b[:, 2]))) > 0.0]
    return sum(any(other is not body and _is_around(other, body[0, 0]) for other in solid) for body in solid)


def _is_around(body: NDArray[np.float64], point: NDArray[np.float64]) -> bool:
    """Whether a closed surface winds once round a point: its solid angles add up to a whole turn."""
    a, b, c = (body[:, k] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return bool(abs(2.0 * np.arctan2(above, below).sum()) > 0.5 * _TURN)
