"""What is true of a triangle surface: connectivity, orientation, degenerate facets, area and volume."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import read_only
from voxkernel._core import duplicate_facets
from voxkernel._frozen import Frozen
from voxkernel.mesh.boundary_loops import boundary_loops
from voxkernel.mesh.edges import surface_edges
from voxkernel.mesh.surface_sums import surface_sums
from voxkernel.mesh.triangles import bounds_of, scale_exponent, unscaled
from voxkernel.mesh.zero_area import is_degenerate

__all__ = ["MeshFacts", "mesh_facts"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MeshFacts(Frozen):
    """Facts of one surface, as `TriangleMesh.facts` returns them.

    Attributes
    ----------
    n_vertices, n_faces, n_facets : int
        Vertices (used or not), triangles, and facets (input polygons).
    is_closed : bool
        Every edge is shared by exactly two triangles: no boundary edge, no non-manifold edge.
    n_boundary_edges, n_nonmanifold_edges : int
        Edges of one triangle; edges of three or more.
    boundary_loops : sequence of (k,) int64 arrays
        The boundary as simple vertex loops, in the direction the triangles traverse it. Each boundary
        edge is in one loop; a chain that ends at non-manifold edges is given as it is.
    is_oriented : bool
        Two triangles at an edge traverse it in opposite directions (at an edge of more than two, the
        two directions are used equally often, or once more one way where the number is odd).
    is_outward : bool or None
        The signed volume of *every* part connected by edges is > 0, decided exactly; a cavity, whose
        triangles rightly face inward, therefore gives False. None where the surface is open or not
        oriented.
    degenerate_facets : (k,) int64
        Ids of the facets whose area is exactly zero.
    nonplanar_facets : (k,) int64
        Ids of the polygons that had to be represented by their triangles.
    n_components : int
        Connected parts; parts that touch in a vertex are one.
    euler_characteristic : int
        Used vertices - edges + triangles.
    genus : int or None
        Handles of one closed, oriented component without pinched vertices; None otherwise.
    area : float
        Mesh units squared.
    volume : float
        Signed enclosed volume, mesh units cubed; nan where the surface is open or not oriented.
    area_centroid : (3,) float64
        Centre of mass of the surface.
    bbox : (2, 3) float64
        Lowest and highest coordinates of the used vertices.
    diagonal : float
        Length of the bounding box's diagonal.
    n_unreferenced_vertices : int
        Vertices no triangle uses.
    n_duplicate_facets : int
        Facets with the same corners as an earlier one, in whatever order.

    Notes
    -----
    A triangle that names a vertex twice is no triangle to topology: it is left out of edges and the Euler
    characteristic, and counted among the degenerate facets.
    """

    n_vertices: int
    n_faces: int
    n_facets: int
    is_closed: bool
    n_boundary_edges: int
    boundary_loops: Sequence[NDArray[np.int64]]
    n_nonmanifold_edges: int
    is_oriented: bool
    is_outward: bool | None
    degenerate_facets: NDArray[np.int64]
    nonplanar_facets: NDArray[np.int64]
    n_components: int
    euler_characteristic: int
    genus: int | None
    area: float
    volume: float
    area_centroid: NDArray[np.float64]
    bbox: NDArray[np.float64]
    diagonal: float
    n_unreferenced_vertices: int
    n_duplicate_facets: int

    def __repr__(self) -> str:
        state = "closed" if self.is_closed else f"open ({len(self.boundary_loops)} boundary loops)"
        oriented = "oriented" if self.is_oriented else "not oriented"
        return (
            f"MeshFacts({self.n_facets} facets, {state}, {oriented}, {self.n_components} components, "
            f"{len(self.degenerate_facets)} degenerate, area={self.area:.6g}, volume={self.volume:.6g})"
        )


def _used_bounds(vertices: NDArray[np.float64], used: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(2, 3) lowest and highest coordinates of the used vertices, which are not copied."""
    if used.all():
        return bounds_of(vertices)
    return np.stack(
        [
            vertices.min(axis=0, where=used[:, None], initial=np.inf),
            vertices.max(axis=0, where=used[:, None], initial=-np.inf),
        ]
    )


def _degenerate_facets(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], facet_ids: NDArray[np.int64]
) -> tuple[int, NDArray[np.int64]]:
    """Number of facets, and those all of whose triangles have no area."""
    is_first = np.ones(len(faces), dtype=bool)
    np.greater(facet_ids[1:], facet_ids[:-1], out=is_first[1:])
    zero = is_degenerate(vertices, faces)
    if is_first.all():
        return len(faces), facet_ids[zero]
    starts = np.flatnonzero(is_first)
    return len(starts), facet_ids[starts[np.logical_and.reduceat(zero, starts)]]


def mesh_facts(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    facet_ids: NDArray[np.int64],
    nonplanar_facets: NDArray[np.int64],
) -> MeshFacts:
    """All facts of a checked mesh; sums run about the bounding box's centre."""
    n_vertices = len(vertices)
    used = np.zeros(n_vertices, dtype=bool)
    used[faces.reshape(-1)] = True
    bbox = _used_bounds(vertices, used)
    exponent = scale_exponent(bbox)
    size = 0.5 * bbox[1] - 0.5 * bbox[0]
    n_facets, degenerate = _degenerate_facets(vertices, faces, facet_ids)
    edges = surface_edges(faces, n_vertices)
    sums = surface_sums(vertices, faces, bbox, edges)
    is_solid = edges.is_closed and edges.is_oriented
    # one fan of triangles round every vertex: no pinched one
    has_genus = is_solid and edges.n_components == 1 and edges.n_fans == edges.n_vertices
    return MeshFacts(
        n_vertices=n_vertices,
        n_faces=len(faces),
        n_facets=n_facets,
        is_closed=edges.is_closed,
        n_boundary_edges=len(edges.border),
        boundary_loops=boundary_loops(faces, n_vertices, edges.border),
        n_nonmanifold_edges=edges.n_nonmanifold,
        is_oriented=edges.is_oriented,
        is_outward=sums.is_outward,
        degenerate_facets=read_only(degenerate),
        nonplanar_facets=nonplanar_facets,
        n_components=edges.n_components,
        euler_characteristic=edges.euler_characteristic,
        genus=(2 - edges.euler_characteristic) // 2 if has_genus else None,
        area=sums.area,
        volume=sums.volume,
        area_centroid=read_only(sums.area_centroid),
        bbox=read_only(bbox),
        diagonal=float(unscaled(np.linalg.norm(np.ldexp(size, -exponent)), exponent + 1)),
        n_unreferenced_vertices=n_vertices - int(np.count_nonzero(used)),
        n_duplicate_facets=duplicate_facets(faces, facet_ids, n_vertices),
    )
