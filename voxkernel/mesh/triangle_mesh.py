"""`TriangleMesh`: a frozen surface that remembers which input polygon every triangle came from."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_facet_ids, as_integers, as_nonnegative, as_points, check_index_range, read_only
from voxkernel._extras import optional
from voxkernel._frozen import Frozen
from voxkernel._thumbnail import BLUE, thumbnail
from voxkernel._viewing import plot_mesh
from voxkernel.errors import MeshError
from voxkernel.mesh.affine import affine_image, as_affine
from voxkernel.mesh.facts import MeshFacts, mesh_facts
from voxkernel.mesh.polygons import areas_of_planes, flatten_polygons, polygon_planes
from voxkernel.mesh.triangles import bounds_of, facet_normals, triangle_areas, used_vertices
from voxkernel.mesh.zero_area import has_area

__all__ = ["MeshFacts", "TriangleMesh"]

_OF_PLANES = ("vertices", "faces", "facet_ids", "plane_corners", "plane_facets", "nonplanar_facets")
_NO_IDS = read_only(np.zeros(0, dtype=np.int64))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TriangleMesh(Frozen):
    """A surface of triangles with the planes of the facets they were cut from.

    Make one with :func:`voxkernel.as_mesh`, `from_triangles` or `from_polygons`; the bare
    constructor checks nothing. All arrays are read-only and own their memory. Vertices and facets keep
    the order of the input and are never merged, moved or dropped.

    Parameters
    ----------
    vertices : (n, 3) float64
        World coordinates exactly as given.
    faces : (m, 3) int64
        Triangles, counter-clockwise seen from outside. Zero-area triangles stay.
    facet_ids : (m,) int64
        The input polygon (*facet*) each triangle belongs to, ascending. A restricted mesh keeps the
        ids of the mesh it came from.
    plane_corners : (p, 3) int64
        Vertex ids of the three corners that *define* each facet plane; their order gives the outward
        normal. One row per triangle facet, per planar polygon, and per triangle of a polygon that is
        not planar.
    plane_facets : (p,) int64
        Facet id of each plane, ascending.
    nonplanar_facets : (k,) int64
        Polygons that were not planar within the tolerance of `from_polygons` (or whose winding has no
        definite side) and are represented by their triangles.
    n_input_facets : int
        Number of polygons of the input: every facet id is below it.
    source : str
        Where the mesh came from, for messages.

    Attributes
    ----------
    plane_areas : (p,) float64
        Area each plane stands for (of a planar polygon: the whole polygon), in mesh units squared.

    Notes
    -----
    Equality is identity. The only state that changes after construction are caches, of `facts` and of the
    arrays made of the vertices: `plane_areas`, `facet_areas`, `facet_normals`, `used_vertices`, `bounds`;
    `dataclasses.replace` leaves them behind.

    Examples
    --------
    >>> mesh = TriangleMesh.from_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> mesh
    TriangleMesh(3 vertices, 1 faces, 1 facets, source='arrays')
    >>> float(mesh.plane_areas[0])
    0.5
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    facet_ids: NDArray[np.int64]
    plane_corners: NDArray[np.int64]
    plane_facets: NDArray[np.int64]
    nonplanar_facets: NDArray[np.int64]
    n_input_facets: int
    source: str
    _plane_areas: NDArray[np.float64] | None = field(init=False, default=None)
    _facts: MeshFacts | None = field(init=False, default=None)
    _derived: Mapping[str, NDArray[np.float64]] = field(init=False, default_factory=lambda: MappingProxyType({}))

    @classmethod
    def from_triangles(
        cls, vertices: ArrayLike, faces: ArrayLike, *, source: str = "arrays"
    ) -> "TriangleMesh":
        """Make a mesh of triangles; every triangle is its own facet.

        Parameters
        ----------
        vertices : (n, 3) array of real numbers
            Finite world coordinates.
        faces : (m, 3) array of integers
            Vertex ids in 0..n-1, counter-clockwise seen from outside, m >= 1.
        source : str
            Name for messages.

        Returns
        -------
        TriangleMesh
            Holds copies; later changes of the arguments do not reach it.

        Raises
        ------
        MeshError
            If a shape is wrong, a coordinate is not finite, an index is out of range, or no triangle
            has a positive area (decided exactly).
        TypeError
            If `vertices` is not real or `faces` is not an integer array.

        Notes
        -----
        O(n + m), a few tens of milliseconds for a million triangles.

        Examples
        --------
        >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
        >>> mesh = TriangleMesh.from_triangles(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
        >>> round(mesh.facts().volume, 12)
        0.166666666667
        """
        points = as_points("vertices", vertices, copy=True, error=MeshError)
        triangles = as_integers("faces", faces, shape="(m, 3)", ndim=2, columns=3, copy=True, error=MeshError)
        if len(triangles) == 0:
            raise MeshError("`faces` must hold at least one triangle; got 0")
        check_index_range("faces", triangles, len(points), error=MeshError)
        if not has_area(points, triangles):
            raise MeshError(f"`faces` must hold a triangle with positive area; got {len(triangles)} without")
        ids = read_only(np.arange(len(triangles), dtype=np.int64))
        read_only(triangles)
        return cls(read_only(points), triangles, ids, triangles, ids, _NO_IDS, len(triangles), source)

    @classmethod
    def from_polygons(
        cls,
        vertices: ArrayLike,
        polygons: ArrayLike | Sequence[Sequence[int]],
        *,
        planarity_rtol: float = 1e-9,
        source: str = "arrays",
    ) -> "TriangleMesh":
        """Make a mesh of polygons; every polygon is one facet with one plane where it is planar.

        Parameters
        ----------
        vertices : (n, 3) array of real numbers
            Finite world coordinates.
        polygons : sequence of index sequences, or (m, k) array of integers
            Each polygon's vertex ids in order, counter-clockwise seen from outside, at least three;
            convex or not, without holes.
        planarity_rtol : float
            A polygon is planar when all corners lie within this times its diameter of the plane through
            three well-spread ones. 0 asks for exact planarity as floats see it. (Of more than 256
            corners the diameter is taken between two that are farthest from each other.)
        source : str
            Name for messages.

        Returns
        -------
        TriangleMesh
            Facet ids are positions in `polygons`. A polygon that is not planar is triangulated, keeps
            its id, gets one plane per triangle and is listed in `nonplanar_facets`.

        Raises
        ------
        MeshError
            If a shape is wrong, a coordinate is not finite, an index is out of range, a polygon has
            fewer than three corners, a polygon crosses itself and visits a vertex twice, or no polygon
            has an area.
        TypeError
            If the ids are not integers.

        Notes
        -----
        The plane's side is that of the Newell normal [1]_. A fan is used where all its triangles keep
        the polygon's side, which includes every strictly convex polygon; ear clipping [2]_ otherwise.
        Compiled except for ear clipping. A polygon may touch itself; the triangles of one that crosses
        itself, without coming back to a vertex, are a fan.

        References
        ----------
        .. [1] I. E. Sutherland, R. F. Sproull, R. A. Schumacker, "A characterization of ten
           hidden-surface algorithms", ACM Computing Surveys 6(1), 1974, doi:10.1145/356625.356626.
        .. [2] mapbox/earcut, https://github.com/mapbox/earcut.hpp

        Examples
        --------
        >>> square = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]]
        >>> mesh = TriangleMesh.from_polygons(square, [[0, 1, 2, 3]])
        >>> mesh.faces.tolist(), len(mesh.plane_corners), float(mesh.plane_areas[0])
        ([[0, 1, 2], [0, 2, 3]], 1, 4.0)
        """
        points = as_points("vertices", vertices, copy=True, error=MeshError)
        flat, sizes = flatten_polygons(polygons)
        rtol = as_nonnegative("planarity_rtol", planarity_rtol)
        return cls._from_flat(points, flat, sizes, planarity_rtol=rtol, source=source)

    @classmethod
    def _from_flat(
        cls,
        points: NDArray[np.float64],
        flat: NDArray[np.int64],
        sizes: NDArray[np.int64],
        *,
        planarity_rtol: float,
        source: str,
    ) -> "TriangleMesh":
        """Polygons as one index array and their sizes: readers have them so, and lists of lists are slow."""
        if len(sizes) == 0:
            raise MeshError("`polygons` must hold at least one polygon; got 0")
        if int(sizes.min()) < 3:
            fewest = f"{int(sizes.min())} in polygon {int(sizes.argmin())}"
            raise MeshError(f"`polygons` must have at least 3 corners each; got {fewest}")
        check_index_range("polygons", flat, len(points), error=MeshError)
        if int(sizes.max()) == 3:
            return cls.from_triangles(points, flat.reshape(-1, 3), source=source)
        cut = polygon_planes(points, flat, sizes, planarity_rtol)
        if not has_area(points, cut.triangles):
            raise MeshError(f"`polygons` must hold one with positive area; got {len(sizes)} without")
        arrays = points, cut.triangles, cut.facet_ids, cut.plane_corners, cut.plane_facets, cut.nonplanar
        return cls._made(read_only(cut.plane_areas), *map(read_only, arrays), len(sizes), source)

    @classmethod
    def _made(cls, areas: NDArray[np.float64] | None, *facts: Any) -> "TriangleMesh":
        """A mesh whose areas of planes are known already, if they are given."""
        mesh = cls(*facts)
        object.__setattr__(mesh, "_plane_areas", areas)
        return mesh

    @property
    def plane_areas(self) -> NDArray[np.float64]:
        """(p,) float64: the area each plane stands for; made at first use and kept."""
        if self._plane_areas is None:
            is_own = self.plane_corners is self.faces
            areas = self.facet_areas if is_own else read_only(areas_of_planes(*(getattr(self, n) for n in _OF_PLANES)))
            object.__setattr__(self, "_plane_areas", areas)
            return areas
        return self._plane_areas

    @property
    def facet_areas(self) -> NDArray[np.float64]:
        """(m,) float64: area of each triangle, in the order of `facet_ids`, mesh units squared; made once and kept."""
        return self._kept("facet_areas", lambda: triangle_areas(self.vertices, self.faces))

    @property
    def facet_normals(self) -> NDArray[np.float64]:
        """(m, 3) float64: outward unit normal of each triangle, in the order of `facet_ids`.

        0 where a triangle has no area, or one too small beside the surface for floats to see.
        """
        return self._kept("facet_normals", lambda: facet_normals(self.vertices, self.faces))

    @property
    def used_vertices(self) -> NDArray[np.float64]:
        """(k, 3) float64: the vertices that a triangle refers to, in order; `vertices` itself where all are."""
        return self._kept("used_vertices", lambda: used_vertices(self.vertices, self.faces))

    @property
    def bounds(self) -> NDArray[np.float64]:
        """(2, 3) float64: lowest and highest coordinates of the used vertices, mesh units."""
        return self._kept("bounds", lambda: bounds_of(self.used_vertices))

    @property
    def volume(self) -> float:
        """Signed enclosed volume, mesh units cubed; nan where the surface is open or not oriented."""
        return self.facts().volume

    def _kept(self, name: str, make: Callable[[], NDArray[np.float64]]) -> NDArray[np.float64]:
        """Make an array once."""
        if name not in self._derived:
            object.__setattr__(self, "_derived", MappingProxyType({**self._derived, name: read_only(make())}))
        return self._derived[name]

    @property
    def n_facets(self) -> int:
        """Number of facets of this mesh (a restricted mesh has fewer than `n_input_facets`)."""
        return 1 + int(np.count_nonzero(np.diff(self.facet_ids)))

    def restricted(self, facets: ArrayLike) -> "TriangleMesh":
        """Keep only some facets: the part of the surface that matters.

        Parameters
        ----------
        facets : (k,) integer ids or (n_input_facets,) bool mask
            Facets to keep. Ids may come in any order and repeat.

        Returns
        -------
        TriangleMesh
            Same vertices (shared memory), same order, original facet ids.

        Raises
        ------
        MeshError
            If an id is not a facet of this mesh, or nothing with an area is left.
        TypeError
            If `facets` is neither integers nor bools.

        Notes
        -----
        A mask may include facets that an earlier restriction removed; they stay removed.

        Examples
        --------
        >>> square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
        >>> mesh = TriangleMesh.from_triangles(square, [[0, 1, 2], [0, 2, 3]])
        >>> mesh.restricted([1]).facet_ids.tolist()
        [1]
        """
        ids = as_facet_ids("facets", facets, upper=self.n_input_facets, error=MeshError)
        keep = np.zeros(self.n_input_facets, dtype=bool)
        keep[self.facet_ids] = True
        if np.asarray(facets).dtype.kind != "b" and not keep[ids].all():
            raise MeshError(f"`facets` must be facets of this mesh; got {int(ids[~keep[ids]][0])}")
        chosen = np.zeros(self.n_input_facets, dtype=bool)
        chosen[ids] = True
        on_face, on_plane = chosen[self.facet_ids], chosen[self.plane_facets]
        faces = self.faces[on_face]
        if len(faces) == 0 or not has_area(self.vertices, faces):
            raise MeshError(f"`facets` must leave a facet with positive area; got {len(ids)} ids without")
        areas = None if self._plane_areas is None else read_only(self._plane_areas[on_plane])
        planes = self.plane_corners[on_plane], self.plane_facets[on_plane]
        arrays = faces, self.facet_ids[on_face], *planes, self.nonplanar_facets[chosen[self.nonplanar_facets]]
        return self._made(areas, self.vertices, *map(read_only, arrays), self.n_input_facets, self.source)

    def transformed(self, matrix: ArrayLike) -> "TriangleMesh":
        """Move, turn, scale or shear the surface.

        Parameters
        ----------
        matrix : (4, 4), (3, 4) or (3, 3) array of real numbers
            The affine map: its first three columns are the linear part, the fourth is the shift (0 where
            there is none); a fourth row must be 0 0 0 1.

        Returns
        -------
        TriangleMesh
            Same facets in the same order. A reflection (negative determinant) turns every facet round, as a
            mirror turns left into right, so that the inside stays inside and a positive volume positive.

        Raises
        ------
        MeshError
            If the shape is another, a number is not finite, the last row is another, the linear part is
            singular (decided exactly), coordinates become too large for floats, or so small that no facet
            has an area.
        TypeError
            If `matrix` is not real.

        Notes
        -----
        O(n). Coordinates are rounded once a step, so facets that were flat are so up to rounding; every
        facet keeps the three corners that define its plane.

        Examples
        --------
        >>> mesh = TriangleMesh.from_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        >>> mesh.transformed([[2, 0, 0, 5], [0, 2, 0, 0], [0, 0, 2, 0]]).bounds.tolist()
        [[5.0, 0.0, 0.0], [7.0, 2.0, 0.0]]
        >>> mirrored = mesh.transformed([[1, 0, 0], [0, 1, 0], [0, 0, -1]])
        >>> mirrored.faces.tolist(), mirrored.facet_normals.tolist()
        ([[0, 2, 1]], [[0.0, 0.0, -1.0]])
        """
        vertices, faces, corners, areas = affine_image(
            as_affine("matrix", matrix), self.vertices, self.faces, self.plane_corners, self._plane_areas
        )
        return TriangleMesh._made(
            areas, vertices, faces, self.facet_ids, corners, self.plane_facets, self.nonplanar_facets,
            self.n_input_facets, self.source,
        )  # fmt: skip

    def facts(self) -> MeshFacts:
        """What is true of this surface: closed, oriented, degenerate facets, boundary loops, volume.

        Returns
        -------
        MeshFacts
            Frozen; computed at the first call and kept.

        Notes
        -----
        Linear time; some 50 bytes a triangle for a while, and more where there are many boundary loops.

        Examples
        --------
        >>> mesh = TriangleMesh.from_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        >>> mesh.facts().is_closed, mesh.facts().n_boundary_edges
        (False, 3)
        """
        if self._facts is None:
            facts = mesh_facts(self.vertices, self.faces, self.facet_ids, self.nonplanar_facets)
            object.__setattr__(self, "_facts", facts)
            return facts
        return self._facts

    def to_arrays(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return writeable copies of the vertices and the triangles.

        Returns
        -------
        vertices : (n, 3) float64
            World coordinates.
        faces : (m, 3) int64
            Triangles.

        Examples
        --------
        >>> mesh = TriangleMesh.from_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        >>> mesh.to_arrays()[1].tolist()
        [[0, 1, 2]]
        """
        return self.vertices.copy(), self.faces.copy()

    def to_open3d(self) -> Any:
        """Return an `open3d.geometry.TriangleMesh` (float64 vertices; int32 triangles).

        Returns
        -------
        open3d.geometry.TriangleMesh
            A copy, without normals or colours.

        Examples
        --------
        >>> mesh = TriangleMesh.from_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        >>> len(mesh.to_open3d().triangles)
        1
        """
        from voxkernel._open3d import open3d_mesh

        return open3d_mesh(self.vertices, self.faces)

    def to_polydata(self) -> Any:
        """Return a `pyvista.PolyData` with the cell array ``facet_id``.

        Returns
        -------
        pyvista.PolyData
            A copy, float64.

        Examples
        --------
        >>> mesh = TriangleMesh.from_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        >>> mesh.to_polydata().n_cells
        1
        """
        data = optional("pyvista").PolyData.from_regular_faces(*self.to_arrays())
        data.cell_data["facet_id"] = self.facet_ids.copy()
        return data

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the triangles; the suffix picks the format.

        Parameters
        ----------
        path : str or os.PathLike
            ``.ply`` and ``.vtp`` (binary, float64), ``.off`` and ``.obj`` (text, 17 digits) keep every coordinate
            exactly; ``.glb`` (float32) and ``.stl`` (binary, float32, no shared vertices) do not.

        Raises
        ------
        ValueError
            If the suffix is none of these.
        OSError
            If the file cannot be written.

        Notes
        -----
        Polygons are written as their triangles.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> mesh = TriangleMesh.from_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     mesh.write(pathlib.Path(folder) / "one.off")
        ...     print((pathlib.Path(folder) / "one.off").read_text().splitlines()[:2])
        ['OFF', '3 1 0']
        """
        from voxkernel.mesh.files import write_triangles

        write_triangles(path, self.vertices, self.faces)

    plot = plot_mesh

    def _picture(self) -> str:
        return thumbnail(self.vertices, self.faces, BLUE)

    def __repr__(self) -> str:
        counts = f"{len(self.vertices)} vertices, {len(self.faces)} faces, {self.n_facets} facets"
        return f"TriangleMesh({counts}, source={self.source!r})"
