"""`repair`: opt-in changes of a surface, each of them reported."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth, as_positive
from voxkernel._extras import optional
from voxkernel._frozen import Frozen
from voxkernel._notebook import InNotebooks
from voxkernel.errors import MeshError
from voxkernel.mesh.as_mesh import as_mesh
from voxkernel.mesh.connected_components import components
from voxkernel.mesh.edges import half_edges
from voxkernel.mesh.files import Polygons, merge_equal_corners
from voxkernel.mesh.mesh_like import MeshLike
from voxkernel.mesh.triangle_mesh import TriangleMesh
from voxkernel.mesh.triangles import doubled_areas, scale_exponent, triple_products, used_vertices

__all__ = ["RepairChange", "RepairResult", "repair"]

_LARGE = 2**31 - 2  # PyMeshLab's integers
_Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]


@dataclass(frozen=True, slots=True)
class RepairChange(InNotebooks):
    """One step of `repair` and what it did.

    Parameters
    ----------
    step : str
        Name of the option.
    text : str
        One line: what was done.
    n_vertices_before, n_vertices_after, n_faces_before, n_faces_after : int
        Counts around the step.
    """

    step: str
    text: str
    n_vertices_before: int
    n_vertices_after: int
    n_faces_before: int
    n_faces_after: int

    def __str__(self) -> str:
        return (
            f"{self.step}: {self.text} (vertices {self.n_vertices_before} -> {self.n_vertices_after}, "
            f"faces {self.n_faces_before} -> {self.n_faces_after})"
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RepairResult(Frozen):
    """A repaired mesh and the list of what was changed, in order.

    Parameters
    ----------
    mesh : TriangleMesh
        The mesh after all steps; the input itself where no step changed anything.
    changes : tuple of RepairChange
        One entry per step that was asked for, also where it found nothing to do; empty without options.
    """

    mesh: TriangleMesh
    changes: tuple[RepairChange, ...]

    def __repr__(self) -> str:
        return f"RepairResult({self.mesh!r}, {len(self.changes)} steps: {'; '.join(map(str, self.changes))})"


def repair(
    mesh: MeshLike,
    *,
    orient: bool = False,
    merge_duplicates: bool = False,
    close_holes: int | None = None,
    remesh_edge_length: float | None = None,
    smooth_steps: int = 0,
    decimate_to: int | None = None,
) -> RepairResult:
    """Change a surface in the ways asked for, and say what was changed.

    Parameters
    ----------
    mesh : anything `as_mesh` takes
        The surface. It is not modified.
    orient : bool
        Turn triangles so that neighbours agree, closed parts face outward (signed volume > 0, cavities
        too), and open parts keep the side most of their area had. A part that has no two sides (Moebius)
        stays as it is; edges of three or more triangles separate parts.
    merge_duplicates : bool
        Give equal positions one vertex; drop triangles that then have two equal corners or repeat an
        earlier triangle in the same direction.
    close_holes : int, optional
        Fill boundary loops of at most this many edges.
    remesh_edge_length : float, optional
        Remesh to triangles of this edge length, in mesh units, > 0.
    smooth_steps : int
        Laplacian smoothing steps, 0 for none.
    decimate_to : int, optional
        Reduce to this many triangles by quadric edge collapse.

    Returns
    -------
    RepairResult
        `mesh` and `changes`. Steps run in this order: `merge_duplicates`, `orient`, `close_holes`,
        `remesh_edge_length`, `smooth_steps`, `decimate_to`.

    Raises
    ------
    MeshError
        If a step cannot work on this surface (for example holes with non-manifold edges), or leaves no
        triangle with an area.
    TypeError, ValueError
        If an option has a wrong type or range.

    Notes
    -----
    `orient` and `merge_duplicates` keep the order of vertices and triangles; the other steps are
    PyMeshLab's [1]_ (GPL-3.0, imported only when one of them is asked for) and make new ones. A changed
    mesh has triangles as facets: polygons and facet ids of the input are gone. Filling, remeshing,
    smoothing and decimating move the surface, and with it the kernel.

    References
    ----------
    .. [1] A. Muntoni, P. Cignoni, "PyMeshLab", 2021, doi:10.5281/zenodo.4438750.

    Examples
    --------
    >>> corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    >>> inside_out = [[0, 1, 2], [0, 3, 1], [1, 3, 2], [0, 2, 3]]
    >>> result = repair((corners, inside_out), orient=True)
    >>> result.mesh.facts().is_outward
    True
    >>> print(result.changes[0])
    orient: turned 4 triangles (vertices 4 -> 4, faces 4 -> 4)
    """
    surface = as_mesh(mesh)
    steps: list[tuple[str, Callable[[_Arrays], tuple[_Arrays, str]]]] = []
    if merge_duplicates:
        steps.append(("merge_duplicates", _merge))
    if orient:
        steps.append(("orient", _orient))
    if close_holes is not None:
        edges = as_depth("close_holes", close_holes, 3, _LARGE)
        steps.append(("close_holes", lambda arrays: _close_holes(arrays, edges)))
    if remesh_edge_length is not None:
        length = as_positive("remesh_edge_length", remesh_edge_length)
        steps.append(("remesh_edge_length", lambda arrays: _remesh(arrays, length)))
    if n_steps := as_depth("smooth_steps", smooth_steps, 0, _LARGE):
        steps.append(("smooth_steps", lambda arrays: _smooth(arrays, n_steps)))
    if decimate_to is not None:
        target = as_depth("decimate_to", decimate_to, 1, _LARGE)
        steps.append(("decimate_to", lambda arrays: _decimate(arrays, target)))
    arrays: _Arrays = surface.vertices, surface.faces
    changes: list[RepairChange] = []
    for name, step in steps:
        after, text = step(arrays)
        counts = len(arrays[0]), len(after[0]), len(arrays[1]), len(after[1])
        changes.append(RepairChange(name, text, *counts))
        arrays = after
    if np.array_equal(arrays[0], surface.vertices) and np.array_equal(arrays[1], surface.faces):
        return RepairResult(surface, tuple(changes))
    source = f"{surface.source} (repaired: {', '.join(name for name, _ in steps)})"
    return RepairResult(TriangleMesh.from_triangles(*arrays, source=source), tuple(changes))


def _merge(arrays: _Arrays) -> tuple[_Arrays, str]:
    """Equal positions become one vertex, repeated triangles one triangle; order stays."""
    soup = Polygons(arrays[0], arrays[1].reshape(-1), np.zeros(0, dtype=np.int64))
    vertices, flat, _ = merge_equal_corners(soup)
    faces = flat.reshape(-1, 3)
    proper = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    lead = faces.argmin(axis=1)[:, None]
    turned = np.take_along_axis(faces, (lead + np.arange(3)) % 3, axis=1)
    order = np.lexsort(turned.T)
    again = np.zeros(len(faces), dtype=bool)
    again[order[1:]] = (turned[order[1:]] == turned[order[:-1]]).all(axis=1)
    text = (
        f"merged {len(arrays[0]) - len(vertices)} vertices, dropped {int((~proper).sum())} collapsed "
        f"and {int((again & proper).sum())} repeated triangles"
    )
    return (vertices, np.ascontiguousarray(faces[proper & ~again])), text


def _orient(arrays: _Arrays) -> tuple[_Arrays, str]:
    """Two nodes per triangle, as it is and turned; components of this double cover are the two choices."""
    vertices, faces = arrays
    edges = half_edges(faces, len(vertices))
    one, other = edges.pairs()
    a, b = one // 3, other // 3
    same = faces.reshape(-1)[one] == faces.reshape(-1)[other]
    n = len(faces)
    rows = np.concatenate([a, a + n])
    columns = np.concatenate([np.where(same, b + n, b), np.where(same, b, b + n)])
    labels = components(2 * n, rows, columns)[1]
    kept, turned = labels[:n], labels[n:]
    one_sided = kept == turned
    part = np.minimum(kept, turned)
    first = kept <= turned  # the choice of a part's lower label
    exponent = scale_exponent(used_vertices(vertices, faces))
    local = np.ldexp(vertices, -exponent)
    local = local - local[faces].mean(axis=(0, 1))
    p, q, r = local[faces[:, 0]], local[faces[:, 1]], local[faces[:, 2]]
    sign = np.where(first, 1.0, -1.0)
    n_parts = int(labels.max()) + 1
    volume = np.bincount(part, weights=sign * triple_products(p, q, r), minlength=n_parts)
    side = np.bincount(part, weights=sign * doubled_areas(local[faces]), minlength=n_parts)
    at_border = np.repeat(edges.n_faces != 2, edges.n_faces)
    border = np.bincount(part[edges.order[at_border] // 3], minlength=n_parts)
    outward = np.where(border == 0, volume, side) >= 0.0
    flip = (first != outward[part]) & ~one_sided
    result = faces.copy()
    result[flip] = result[flip][:, [0, 2, 1]]
    text = f"turned {int(flip.sum())} triangles"
    if one_sided.any():
        text += f", left {int(one_sided.sum())} in parts without two sides"
    return (vertices, result), text


def _meshlab(arrays: _Arrays, step: str, name: str, **options: Any) -> _Arrays:
    """Run one PyMeshLab filter on copies."""
    pymeshlab = optional("pymeshlab")
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(np.array(arrays[0]), np.array(arrays[1])))
    try:
        getattr(meshes, name)(**options)
    except pymeshlab.PyMeshLabException as error:
        details = " ".join(str(error).split("Details:")[-1].split())
        raise MeshError(f"`{step}` must be given a surface PyMeshLab can handle; got: {details}") from error
    done = meshes.current_mesh()
    vertices = np.array(done.vertex_matrix(), dtype=np.float64).reshape(-1, 3)
    faces = np.array(done.face_matrix(), dtype=np.int64).reshape(-1, 3)
    if len(faces) == 0:
        raise MeshError(f"`{step}` must leave triangles; got none")
    return vertices, faces


def _close_holes(arrays: _Arrays, edges: int) -> tuple[_Arrays, str]:
    """PyMeshLab fills holes of *fewer* edges than `maxholesize`."""
    options = {"maxholesize": edges + 1, "newfaceselected": False}
    after = _meshlab(arrays, "close_holes", "meshing_close_holes", **options)
    return after, f"filled holes of at most {edges} edges with {len(after[1]) - len(arrays[1])} triangles"


def _remesh(arrays: _Arrays, length: float) -> tuple[_Arrays, str]:
    target = optional("pymeshlab").PureValue(length)
    after = _meshlab(arrays, "remesh_edge_length", "meshing_isotropic_explicit_remeshing", targetlen=target)
    return after, f"remeshed to edges of {length:g}"


def _smooth(arrays: _Arrays, n_steps: int) -> tuple[_Arrays, str]:
    after = _meshlab(arrays, "smooth_steps", "apply_coord_laplacian_smoothing", stepsmoothnum=n_steps)
    moved = float(np.abs(after[0] - arrays[0]).max()) if len(after[0]) == len(arrays[0]) else float("nan")
    return after, f"{n_steps} Laplacian steps, coordinates moved by up to {moved:.3g}"


def _decimate(arrays: _Arrays, target: int) -> tuple[_Arrays, str]:
    if len(arrays[1]) <= target:
        return arrays, f"already at most {target} triangles"
    name = "meshing_decimation_quadric_edge_collapse"
    return _meshlab(arrays, "decimate_to", name, targetfacenum=target), f"decimated to {target} triangles"
