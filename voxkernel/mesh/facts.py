"""What is true of a triangle surface: connectivity, orientation, degenerate facets, area and volume."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import read_only
from voxkernel._frozen import Frozen
from voxkernel.mesh.connected_components import components
from voxkernel.mesh.edges import HalfEdges, are_oriented, edge_parts, half_edges, loops_of
from voxkernel.mesh.triangles import bounds_of, scale_exponent, scaled_triangle_areas, triple_products, unscaled
from voxkernel.mesh.zero_area import exact_integers, is_degenerate

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
    boundary_loops : tuple of (k,) int64 arrays
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
    boundary_loops: tuple[NDArray[np.int64], ...]
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


def _n_components(faces: NDArray[np.int64], used: NDArray[np.bool_]) -> int:
    """Connected parts of the used vertices."""
    n = len(used)
    rows = np.concatenate([faces[:, 0], faces[:, 0]])
    columns = np.concatenate([faces[:, 1], faces[:, 2]])
    return components(n, rows, columns)[0] - int(n - used.sum())


def _is_vertex_manifold(edges: HalfEdges, faces: NDArray[np.int64], n_used: int) -> bool:
    """One fan of triangles round every vertex? Corners of a closed surface are linked across edges."""
    left, right = edges.pairs()
    next_left, next_right = left - left % 3 + (left + 1) % 3, right - right % 3 + (right + 1) % 3
    rows, columns = np.concatenate([left, next_left]), np.concatenate([next_right, right])
    return components(faces.size, rows, columns)[0] == n_used


def _component_signs(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    local: NDArray[np.float64],
    six_volumes: NDArray[np.float64],
    n_parts: int,
    labels: NDArray[np.int32],
) -> bool:
    """Is every part's signed volume > 0? The float sum where it is certain, integers where it is not."""
    sums = np.bincount(labels, weights=six_volumes, minlength=n_parts)
    n_faces = np.bincount(labels, minlength=n_parts)
    # a term a.(b x c) of rounded coordinates is off by < 32 u of 6 |a| |b| |c|; n terms add n u of their sum
    reach = np.abs(local).max(axis=1)
    sizes = 6.0 * reach[faces[:, 0]] * reach[faces[:, 1]] * reach[faces[:, 2]]
    terms = np.bincount(labels, weights=np.abs(six_volumes), minlength=n_parts)
    rounding = np.bincount(labels, weights=sizes, minlength=n_parts)
    bound = 2.0**-52 * (n_faces * terms + 32.0 * rounding) + 1e-290
    if (sums < -bound).any():
        return False
    for part in np.flatnonzero(sums <= bound):
        corners = exact_integers(vertices[faces[labels == part]])
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        cross = b[:, [1, 2, 0]] * c[:, [2, 0, 1]] - b[:, [2, 0, 1]] * c[:, [1, 2, 0]]
        if (a * cross).sum() <= 0:
            return False
    return True


def _n_duplicate_facets(faces: NDArray[np.int64], facet_ids: NDArray[np.int64]) -> int:
    """Facets with the vertex set of an earlier one."""
    starts = np.flatnonzero(np.concatenate([[True], np.diff(facet_ids) > 0]))
    n_triangles = np.diff(np.append(starts, len(faces)))
    single = starts[n_triangles == 1]
    total = _n_repeated_rows(np.sort(faces[single], axis=1))
    if len(single) == len(starts):
        return total
    several = np.repeat(n_triangles > 1, n_triangles)
    pairs = np.stack([np.repeat(facet_ids[several], 3), faces[several].reshape(-1)], axis=1)
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    pairs = pairs[np.concatenate([[True], (np.diff(pairs, axis=0) != 0).any(axis=1)])]
    begins = np.flatnonzero(np.concatenate([[True], np.diff(pairs[:, 0]) > 0]))
    sizes = np.diff(np.append(begins, len(pairs)))
    for size in np.unique(sizes):
        total += _n_repeated_rows(pairs[begins[sizes == size, None] + np.arange(size), 1])
    return total


def _n_repeated_rows(rows: NDArray[np.int64]) -> int:
    """Rows equal to an earlier row."""
    if len(rows) < 2:
        return 0
    ordered = rows[np.lexsort(rows.T[::-1])]
    return int((np.diff(ordered, axis=0) == 0).all(axis=1).sum())


def mesh_facts(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    facet_ids: NDArray[np.int64],
    nonplanar_facets: NDArray[np.int64],
) -> MeshFacts:
    """All facts of a checked mesh in one pass; sums run about the bounding box's centre."""
    used = np.zeros(len(vertices), dtype=bool)
    used[faces.reshape(-1)] = True
    bbox = bounds_of(vertices[used])
    exponent = scale_exponent(bbox)
    size = 0.5 * bbox[1] - 0.5 * bbox[0]
    centre = 0.5 * bbox[0] + 0.5 * bbox[1]
    scaled = np.ldexp(vertices if used.all() else np.where(used[:, None], vertices, centre), -exponent)
    local = scaled - np.ldexp(centre, -exponent)
    areas = scaled_triangle_areas(scaled, faces, 0)
    area = float(areas.sum())
    middle = local[faces[:, 0]] + local[faces[:, 1]] + local[faces[:, 2]]
    centroid = (areas @ middle) / (3.0 * area) if area > 0.0 else middle.mean(axis=0) / 3.0

    zero = is_degenerate(vertices, faces)
    starts = np.flatnonzero(np.concatenate([[True], np.diff(facet_ids) > 0]))
    degenerate = facet_ids[starts[np.logical_and.reduceat(zero, starts)]]

    proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    solid = faces if proper.all() else faces[proper]
    on_solid = np.zeros(len(vertices), dtype=bool)
    on_solid[solid.reshape(-1)] = True
    edges = half_edges(solid, len(vertices))
    border = edges.order[edges.first[edges.n_faces == 1]]
    n_nonmanifold = int((edges.n_faces > 2).sum())
    n_components = _n_components(faces, used)
    is_closed = len(border) == 0 and n_nonmanifold == 0
    is_oriented = are_oriented(edges)
    euler = int(on_solid.sum()) - len(edges.first) + len(solid)
    volume, is_outward, genus = float("nan"), None, None
    if is_closed and is_oriented:
        n_parts, labels = edge_parts(edges, len(solid))
        a, b, c = (local[solid[:, k]] for k in range(3))
        six_volumes = triple_products(a, b, c)
        volume = float(unscaled(six_volumes.sum() / 6.0, 3 * exponent))
        is_outward = _component_signs(vertices, solid, local, six_volumes, n_parts, labels)
        if n_components == 1 and _is_vertex_manifold(edges, solid, int(on_solid.sum())):
            genus = (2 - euler) // 2
    return MeshFacts(
        n_vertices=len(vertices),
        n_faces=len(faces),
        n_facets=len(starts),
        is_closed=is_closed,
        n_boundary_edges=len(border),
        boundary_loops=loops_of(solid.reshape(-1)[border], solid[:, [1, 2, 0]].reshape(-1)[border]),
        n_nonmanifold_edges=n_nonmanifold,
        is_oriented=is_oriented,
        is_outward=is_outward,
        degenerate_facets=read_only(degenerate),
        nonplanar_facets=nonplanar_facets,
        n_components=n_components,
        euler_characteristic=euler,
        genus=genus,
        area=float(unscaled(area, 2 * exponent)),
        volume=volume,
        area_centroid=read_only(centre + np.ldexp(centroid, exponent)),
        bbox=read_only(bbox),
        diagonal=float(unscaled(np.linalg.norm(np.ldexp(size, -exponent)), exponent + 1)),
        n_unreferenced_vertices=int(len(vertices) - used.sum()),
        n_duplicate_facets=_n_duplicate_facets(faces, facet_ids),
    )
