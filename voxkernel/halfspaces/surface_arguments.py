"""What the arguments `surface`, `facets`, `domain` and `frame` of a function stand for, and the default domains."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_choice, as_facet_ids
from voxkernel.halfspaces.domain import Domain, as_domain, ball_domain, surface_frame
from voxkernel.halfspaces.half_spaces import HalfSpaces
from voxkernel.mesh import MeshLike, TriangleMesh, as_mesh

__all__ = [
    "DEFAULT_DOMAINS",
    "EXACT",
    "NO_DOMAIN",
    "REGISTRATION",
    "RELAXED",
    "DefaultDomain",
    "Frame",
    "SurfaceArgument",
    "SurfaceLike",
    "surface_argument",
]

Frame = Literal["world", "principal"]
SurfaceLike: TypeAlias = MeshLike | HalfSpaces


class DefaultDomain(NamedTuple):
    """Where a kernel is looked for when no domain is given; "" is everywhere.

    `closed` is for surfaces that bound a volume, `opened` for all others, `half_spaces` for half-spaces without a
    mesh. `docs/domains.md` shows these rows; a test holds both together.
    """

    functions: tuple[str, ...]
    closed: Literal["", "hull", "ball"]
    opened: Literal["", "ball"]
    half_spaces: Literal["", "must be given", "not taken"]
    why: str


EXACT = DefaultDomain(
    ("exact_kernel", "voxel_kernel without tolerance or margin", "starshapeness, volume", "spherical_map"),
    closed="", opened="ball", half_spaces="",
    why="The kernel of a closed surface lies inside it; that of an open one can have no end.",
)  # fmt: skip
RELAXED = DefaultDomain(
    (
        "voxel_kernel with tolerance or margin", "voxel_kernels", "violation_grid", "defect_profile",
        "best_center", "starshapeness, defect and profile", "spherical_map from a relaxed centre",
    ),
    closed="hull", opened="ball", half_spaces="must be given",
    why="A relaxed kernel of a closed surface leaks out of it; the hull of an open one cuts at its crop border.",
)  # fmt: skip
REGISTRATION = DefaultDomain(
    ("register", "register_many", "register_together", "prepare_surface"),
    closed="ball", opened="ball", half_spaces="not taken",
    why="Crops of one object have other hulls, and the border of a crop would end the kernel.",
)  # fmt: skip
NO_DOMAIN = DefaultDomain(
    ("violation", "visible_fraction", "guards", "cell_kernels", "exact_kernels"),
    closed="", opened="", half_spaces="",
    why="The points are given, or lie where the surface can be seen; the kernel of a cell lies inside it, and an open "
    "cell has none.",
)  # fmt: skip
DEFAULT_DOMAINS = (EXACT, RELAXED, REGISTRATION, NO_DOMAIN)


class SurfaceArgument(NamedTuple):
    """A surface as functions use it: half-spaces, and the mesh they were made from unless they were given."""

    halfspaces: HalfSpaces
    mesh: TriangleMesh | None

    def domain(self, given: Any, default: DefaultDomain) -> Domain | None:
        """Turn a `domain` argument into a domain, with the default of a row of the table; None is everywhere."""
        if given is not None:
            return as_domain(given, self.mesh)
        if self.mesh is None:
            if default.half_spaces == "":
                return None
            raise ValueError("`domain` must be given for half-spaces; got None")
        name = default.closed if self.halfspaces.bounds_volume else default.opened
        if name != "hull":
            return as_domain(name or None, self.mesh)
        try:
            return as_domain(name, self.mesh)
        except ValueError:  # a closed surface that lies in one plane, or nearly
            return ball_domain(self.mesh)

    def bounded_domain(self, given: Any) -> Domain:
        """Turn a `domain` argument into where relaxed kernels are looked for, which always has an end."""
        found = self.domain(given, RELAXED)
        assert found is not None  # the row has no ""
        return found

    def axes(self, frame: Frame) -> NDArray[np.float64]:
        """Turn a `frame` argument into unit axes, as rows."""
        as_choice("frame", frame, ("world", "principal"))
        if frame == "world":
            return np.eye(3)
        if self.mesh is None:
            raise ValueError("`frame` must be 'world' for half-spaces; got 'principal'")
        return surface_frame(self.mesh)[1]

    def own_axes(self) -> NDArray[np.float64]:
        """Give the principal axes of a mesh, the world's for half-spaces: searches move with the surface."""
        return self.axes("world" if self.mesh is None else "principal")


def surface_argument(surface: SurfaceLike, facets: Any = None, *, threads: int = 1) -> SurfaceArgument:
    """Take half-spaces as they are, without a mesh; make them from anything `as_mesh` takes.

    `facets` are facets of a mesh, rows of half-spaces: ids in any order, or a mask; the order stays that of the input.
    """
    if not isinstance(surface, HalfSpaces):
        mesh = surface if isinstance(surface, TriangleMesh) and facets is None else as_mesh(surface, facets=facets)
        return SurfaceArgument(HalfSpaces.from_mesh(mesh, threads=threads), mesh)
    if facets is None:
        return SurfaceArgument(surface, None)
    ids = as_facet_ids("facets", facets, upper=len(surface))
    if not len(ids):
        raise ValueError("`facets` must name at least one half-space; got none")
    return SurfaceArgument(surface.select(ids), None)
