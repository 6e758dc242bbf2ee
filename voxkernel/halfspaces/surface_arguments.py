"""What the arguments `surface`, `facets` and `domain` of a function stand for."""

from __future__ import annotations

from typing import Any

import numpy as np

from voxkernel.halfspaces.domain import Domain, as_domain, ball_domain, hull_domain
from voxkernel.halfspaces.half_spaces import HalfSpaces
from voxkernel.mesh import TriangleMesh, as_mesh

__all__ = ["halfspaces_of", "relaxed_domain", "resolve_surface"]


def resolve_surface(
    surface: Any, *, facets: Any = None, domain: Any = None, default: str = "ball"
) -> tuple[HalfSpaces, Domain | None]:
    """Turn surface and domain arguments into half-spaces and a domain, with the defaults of the library."""
    if isinstance(surface, HalfSpaces):
        halfspaces = surface if facets is None else surface.select(np.asarray(facets))
        return halfspaces, as_domain(domain, None)
    mesh = as_mesh(surface, facets=facets)
    halfspaces = HalfSpaces.from_mesh(mesh)
    if domain is None and not halfspaces.bounds_volume:
        return halfspaces, ball_domain(mesh) if default == "ball" else as_domain(default, mesh)
    return halfspaces, as_domain(domain, mesh)


def relaxed_domain(is_closed: bool, mesh: TriangleMesh | None, domain: Any) -> Domain:
    """Choose where relaxed kernels are looked for: given, or the hull of closed surfaces, or the ball polytope."""
    if domain is not None:
        found = as_domain(domain, mesh)
        if found is not None:
            return found
    if mesh is None:
        raise ValueError("`domain` must be given for half-spaces; got None")
    if not is_closed:
        return ball_domain(mesh)
    try:
        return hull_domain(mesh)
    except ValueError:  # a closed surface that lies in one plane
        return ball_domain(mesh)


def halfspaces_of(surface: Any, facets: Any) -> tuple[HalfSpaces, TriangleMesh | None]:
    """Take half-spaces as they are, without a mesh; make them from anything `as_mesh` takes."""
    if isinstance(surface, HalfSpaces):
        return (surface if facets is None else surface.select(np.asarray(facets))), None
    mesh = as_mesh(surface, facets=facets)
    return HalfSpaces.from_mesh(mesh), mesh
