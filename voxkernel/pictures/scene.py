"""What a picture of a surface and its kernel shows, as plain arrays: shared by PNG and HTML."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel.exact import Kernel, KernelPolytope
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.connected_components import components
from voxkernel.mesh.edges import half_edges
from voxkernel.mesh.triangles import bounds_of, doubled_normals, used_vertices, without_strays
from voxkernel.pictures.camera import seen_upright
from voxkernel.pictures.creases import SHARP_DEG
from voxkernel.pictures.domain_outline import domain_outline, is_cut_by_domain
from voxkernel.pictures.level_surface import RESOLUTION, level_surface

__all__ = ["CENTER", "DOMAIN", "KERNEL", "LINE", "RELAXED", "SURFACE", "WITNESS", "Scene", "caption_of", "make_scene"]

SURFACE, KERNEL, WITNESS, LINE = "#7fb0e6", "#ff7a14", "#d3202f", "#2f4460"
RELAXED = "#a34a9c"  # apart from the orange of exact kernels for every kind of colour vision
CENTER, DOMAIN = "#ffe14d", "#26323e"
_KERNEL_LINE, _RELAXED_LINE = "#7a3300", "#4b1b48"

_CENTER_NAMES = ("deepest point", "star centre")

# Sharp edges are drawn; on coarse surfaces every edge that is not flat.
_COARSE = 300
_FLAT = 1.0 - 1e-6
# Sharp edges that hang together for less than this share of the diagonal are specks, not features.
_SPECK = 0.3
_PAIRS = 5e8  # samples times facets of a contour: about a second
_LEAST = 16  # samples along an edge; voxels look better than fewer
_Y_UP = (".glb", ".gltf")  # by their specification


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Scene(Frozen):
    """Triangles, lines and points to draw, world coordinates.

    `kernel_lines` and `surface_lines` are (k, 2, 3) segments. `witness_faces` are surface triangles of
    the certificate of an empty kernel; from the centre of each, `witness_inward` points to its inner side.
    `tolerance` is that of a relaxed kernel, 0 of an exact one: they never look alike. `domain_lines` outline the domain
    `domain_name` where it cuts the kernel, else there are none; `center` has one row or none.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    surface_lines: NDArray[np.float64]
    is_open: bool
    kernel_vertices: NDArray[np.float64]
    kernel_faces: NDArray[np.int64]
    kernel_lines: NDArray[np.float64]
    witness_faces: NDArray[np.int64]
    witness_centers: NDArray[np.float64]
    witness_inward: NDArray[np.float64]
    view: NDArray[np.float64]
    up: NDArray[np.float64]
    tolerance: float
    domain_lines: NDArray[np.float64]
    domain_name: str
    center: NDArray[np.float64]
    center_name: str
    is_smooth: bool  # of the kernel: a level surface, not faces or voxels

    def __repr__(self) -> str:
        """Count what is drawn."""
        return f"Scene({len(self.faces)} triangles, kernel of {len(self.kernel_faces)})"

    @property
    def kernel_color(self) -> str:
        """Orange for an exact kernel, purple for a relaxed one."""
        return RELAXED if self.tolerance else KERNEL

    @property
    def kernel_line_color(self) -> str:
        """A dark shade of the same."""
        return _RELAXED_LINE if self.tolerance else _KERNEL_LINE

    @property
    def kernel_name(self) -> str:
        """What a legend calls it."""
        return f"relaxed kernel, {_percent(self.tolerance)} of the area turned away" if self.tolerance else "kernel"

    @property
    def points(self) -> NDArray[np.float64]:
        """(k, 3): every vertex drawn."""
        parts = (used_vertices(self.vertices, self.faces), self.kernel_vertices, self.domain_lines.reshape(-1, 3))
        return np.concatenate([*parts, self.center])

    @property
    def diagonal(self) -> float:
        """Length of the diagonal of the surface's bounding box."""
        return float(np.linalg.norm(np.diff(bounds_of(used_vertices(self.vertices, self.faces)), axis=0)))


def make_scene(
    mesh: TriangleMesh, kernel: Any, *, up: NDArray[np.float64] | None = None, resolution: int = RESOLUTION,
    center: NDArray[np.float64] | None = None,
) -> Scene:  # fmt: skip
    """Collect what to draw; `kernel` is a KernelPolytope, a KernelGrid or None, `up` a unit vector or None.

    A relaxed kernel is contoured with that `resolution`, or a coarser one of large surfaces; 0 shows its voxels, as do
    surfaces of more than some 120,000 facets: each sample is held against each facet. `center` is the point to mark;
    of a polytope the deepest one by default.
    """
    corners = mesh.vertices[mesh.faces]
    normals = mesh.facet_normals
    lines, is_open = _feature_lines(mesh, normals)
    tolerance = float(getattr(kernel, "tolerance", 0.0))
    points, triangles, edges = _kernel_parts(kernel)
    cut = kernel.domain if kernel is not None and is_cut_by_domain(kernel, points) else None
    is_smooth = False
    resolution = _affordable(resolution, mesh.n_facets)
    if tolerance and resolution and len(points) and kernel is not None:
        smooth = level_surface(mesh, kernel, resolution=resolution)
        is_smooth = len(smooth[1]) > 0  # a kernel thinner than the samples is shown as its voxels
        if is_smooth:
            points, triangles = smooth
    if center is None and isinstance(kernel, KernelPolytope) and kernel.dimension == 3:
        center = kernel.deepest_point
    witness = np.zeros(0, np.int64)
    if kernel is not None and len(points) == 0:
        ids = [i for i in getattr(getattr(kernel, "certificate", None), "facet_ids", ()) if i >= 0]
        # One triangle stands for each facet: the arrow needs one place.
        witness = np.array([int(np.flatnonzero(mesh.facet_ids == i)[0]) for i in ids], np.int64)
    view, upward = _camera(mesh, doubled_normals(corners), points, is_open)
    if up is not None:
        view, upward = seen_upright(view, upward, up)
    none = np.zeros((0, 2, 3))
    # Programs that draw make room for every vertex they are given.
    return Scene(
        *without_strays(mesh.vertices, mesh.faces), lines, is_open, points, triangles, edges,
        np.flatnonzero(np.isin(mesh.facet_ids, mesh.facet_ids[witness])),
        corners[witness].mean(axis=1), -normals[witness], view, upward, tolerance,
        none if cut is None else domain_outline(cut), "" if cut is None else cut.kind,
        np.zeros((0, 3)) if center is None else center.reshape(1, 3), _CENTER_NAMES[bool(tolerance)],
        is_smooth,
    )  # fmt: skip


def _affordable(resolution: int, n_facets: int) -> int:
    most = int((_PAIRS / max(n_facets, 1)) ** (1.0 / 3.0))
    return resolution if resolution <= most else most if most >= _LEAST else 0


def _upward(mesh: TriangleMesh, front: NDArray[np.float64]) -> NDArray[np.float64]:
    """Up is y or z, as the file says, else the longer of the two, z of about equal ones; never what is in front."""
    sizes = np.ptp(mesh.used_vertices, axis=0)
    if str(mesh.source or "").lower().endswith(_Y_UP):
        axis = 1
    else:
        axis = 1 if sizes[1] > 1.1 * sizes[2] else 2
    if abs(front[axis]) >= 0.7:
        axis = 3 - axis
    return np.eye(3)[axis]


def caption_of(mesh: TriangleMesh, kernel: Any) -> str:
    """Say verdict, volume and ratio in one line."""
    if kernel is None:
        return f"{mesh.n_facets:,} facets"
    tolerance = float(getattr(kernel, "tolerance", 0.0))
    if tolerance > 0.0:
        low, high = kernel.volume_bounds
        size = f"volume between {low:.4g} and {high:.4g}" if high else "empty"
        return f"relaxed kernel: faces all but {_percent(tolerance)} of the area; {size}"
    dimension = int(getattr(kernel, "unclipped_dimension", kernel.dimension))
    if dimension < 0:
        n = len([i for i in getattr(getattr(kernel, "certificate", None), "facet_ids", ()) if i >= 0])
        return "not star-shaped" + (f": no point is on the inner side of all {n} red facets" if n else "")
    if dimension < 3:
        return f"degenerate: the kernel is only a {('point', 'segment', 'flat polygon')[dimension]}"
    low, high = getattr(kernel, "volume_bounds", (kernel.volume, kernel.volume))
    if high - low > 1e-4 * high:
        return f"star-shaped, kernel volume between {low:.4g} and {high:.4g}"
    text = f"star-shaped, kernel volume {kernel.volume:.4g}"
    facts = mesh.facts()
    domain = getattr(kernel, "domain", None)
    if facts.is_closed and facts.is_oriented and facts.volume > 0:
        return f"{text}, {_percent(kernel.volume / facts.volume)} of the enclosed volume"
    if domain is not None and domain.volume > 0:
        return f"{text} inside the {domain.kind}, {_percent(kernel.volume / domain.volume)} of it"
    return text


def _percent(ratio: float) -> str:
    return f"{100.0 * ratio:.4g} %"


def _feature_lines(mesh: TriangleMesh, normals: NDArray[np.float64]) -> tuple[NDArray[np.float64], bool]:
    """Edges worth drawing: the boundary, sharp edges, and on coarse surfaces every edge that is not flat."""
    faces = mesh.faces
    edges = half_edges(faces, len(mesh.vertices))
    ends, counts = edges.ends(faces), edges.n_faces
    one, other = edges.order[edges.first] // 3, edges.order[np.minimum(edges.first + 1, faces.size - 1)] // 3
    bend = np.einsum("ij,ij->i", normals[one], normals[other])
    drawn = (counts != 2) | (bend < np.cos(np.radians(SHARP_DEG)))
    if mesh.n_facets <= _COARSE:
        drawn |= (mesh.facet_ids[one] != mesh.facet_ids[other]) & (bend < _FLAT)
    segments = mesh.vertices[ends[drawn]]
    if mesh.n_facets > _COARSE and len(segments):
        size = float(np.linalg.norm(np.diff(mesh.bounds, axis=0)))
        segments = segments[_is_long(ends[drawn], segments, _SPECK * size)]
    # A surface that is rough everywhere has no feature lines, only noise.
    if mesh.n_facets > _COARSE and len(segments) > 0.2 * len(ends):
        segments = mesh.vertices[ends[counts != 2]]
    return segments, bool((counts == 1).any())


def _is_long(ends: NDArray[np.int64], segments: NDArray[np.float64], least: float) -> NDArray[np.bool_]:
    """Which segments belong to a connected set of at least that length."""
    ids, local = np.unique(ends, return_inverse=True)
    local = local.reshape(-1, 2)
    n, label = components(len(ids), local[:, 0], local[:, 1])
    lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    total = np.bincount(label[local[:, 0]], weights=lengths, minlength=n)
    return total[label[local[:, 0]]] >= least


def _kernel_parts(kernel: Kernel | None) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
    none = np.zeros((0, 3)), np.zeros((0, 3), np.int64), np.zeros((0, 2, 3))
    if kernel is None:
        return none
    if not isinstance(kernel, KernelPolytope):
        if not len(kernel.to_points()):
            return none
        mesh = kernel.to_mesh()
        return mesh.vertices, mesh.faces, none[2]
    # Where the kernel touches the surface the two would flicker: draw it a little smaller.
    points: NDArray[np.float64] = kernel.vertices
    if len(points):
        points = points + 3e-3 * (points.mean(axis=0) - points)
    if not kernel.faces:
        return points, none[1], points[None] if len(points) == 2 else none[2]
    fans = [np.column_stack([np.full(len(f) - 2, f[0]), f[1:-1], f[2:]]) for f in kernel.faces]
    around = [np.column_stack([f, np.roll(f, -1)]) for f in kernel.faces]
    return points, np.concatenate(fans), points[np.unique(np.sort(np.concatenate(around), axis=1), axis=0)]


def _camera(
    mesh: TriangleMesh, doubled: NDArray[np.float64], kernel: NDArray[np.float64], is_open: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Look along the thinnest direction of a closed surface, beside the front of an open one; never straight on."""
    sizes, axes = np.linalg.eigh(np.cov(mesh.used_vertices.T))
    front = axes[:, 0] if sizes[0] < 0.8 * sizes[1] else np.array([0.0, 0.0, 1.0])
    front = front * np.where(front[np.argmax(np.abs(front))] < 0, -1.0, 1.0)
    facing = doubled.sum(axis=0)
    is_open = is_open and float(np.linalg.norm(facing)) > 0.2 * float(np.linalg.norm(doubled, axis=1).sum())
    if is_open:
        front = facing / np.linalg.norm(facing)
    up = _upward(mesh, front)
    right = np.cross(up, front)
    right /= np.linalg.norm(right)
    # The kernel of an open surface is behind it: look from the side.
    ahead, aside, above = (0.6, 0.76, 0.25) if is_open and len(kernel) else (0.8, 0.42, 0.5)
    view = ahead * front + aside * right + above * np.cross(front, right)
    return view / np.linalg.norm(view), up
