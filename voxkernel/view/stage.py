"""What is shown -> actors of a VTK window that is never drawn here: the browser draws it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel._palette import INK, distinct_color, hex_of, rgb_of
from voxkernel.pictures.camera import place_to_see
from voxkernel.pictures.creases import SHARP_DEG
from voxkernel.pictures.scene import LINE, SURFACE, WITNESS, Scene, make_scene
from voxkernel.pictures.silent_vtk import silent_vtk
from voxkernel.view.shown import Shown

__all__ = ["HIDDEN", "PROOF", "Stage"]

# Red is what the probe does not face, so that the facets of the proof have a colour of their own.
HIDDEN, PROOF, PROBE = "#3d5a80", "#f0c000", INK
_ANGLE = 30.0  # of the browser's camera, degrees
_ASPECT = 1.2  # of the picture, in a window of usual size
_RESOLUTION = 24  # of relaxed kernels, as one waits for them
_BALL = 0.014  # radius of guards, in diagonals


class Stage:
    """Actors in a frame of their own, so that single precision holds: the diagonal is 1 and the middle is 0."""

    def __init__(self, shown: Shown) -> None:
        self._pv = optional("pyvista")
        self.shown = shown
        self._scenes: dict[int, Scene] = {0: make_scene(shown.mesh, shown.kernels[0], up=shown.up)}
        scene = self._scenes[0]
        self._middle = shown.mesh.bounds.mean(axis=0)
        self.diagonal = scene.diagonal
        self._plane: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
        self._kernel = 0
        self._wanted: dict[Any, bool] = {}  # by actor, all others are shown
        self._dot = self._pv.PolyData(np.zeros((1, 3)))  # stands, hidden, where there is nothing to draw
        with silent_vtk():
            plotter: Any = self._pv.Plotter(off_screen=True)
            plotter.set_background("white")
            self._plotter = plotter
            # Triangle k of the mesh is cell k, also where shading wants vertices twice; `scene` may have left some out.
            vertices, faces = self._used(shown.mesh.vertices, shown.mesh.faces)
            whole = self._pv.PolyData.from_regular_faces(self.to_local(vertices), faces)
            self._whole = whole.compute_normals(
                split_vertices=True, feature_angle=SHARP_DEG, consistent_normals=False, auto_orient_normals=False
            )
            self._whole.cell_data["triangle"] = np.arange(len(faces))
            self._alpha = 0.4
            self._away = self._hidden = np.zeros(len(faces), bool)
            self._surface = self._add(self._whole, scalars="rgba", rgb=True, **_MATERIAL)
            self._lines = self._add(self._segments(scene.surface_lines), color=LINE, line_width=2.0, lighting=False)
            self._solid = self._add(self._pv.PolyData(), color=scene.kernel_color, ambient=0.35, diffuse=0.7)
            self._edges = self._add(self._pv.PolyData(), color=scene.kernel_line_color, line_width=2.0, lighting=False)
            self._rim = self._add(self._pv.PolyData(), color=PROBE, line_width=3.0, lighting=False)
            self._witness = self._add(self._witness_parts(scene), color=PROOF, ambient=0.5, diffuse=0.6)
            self._guards = [
                self._add(self._ball(point, _BALL), color=hex_of(distinct_color(i)), ambient=0.5, diffuse=0.6)
                for i, point in enumerate(() if shown.guards is None else shown.guards.points)
            ]
            self._probe = self._add(self._ball(self._middle, 0.011), color=PROBE, ambient=0.5, diffuse=0.6)
            camera = plotter.camera
            camera.view_angle = _ANGLE
            points = self.to_local(scene.points)
            focus, distance = place_to_see(points, scene.view, scene.up, aspect=_ASPECT, angle=_ANGLE, margin=1.1)
            camera.focal_point, camera.position = tuple(focus), tuple(focus + distance * scene.view)
            camera.up = tuple(scene.up)
        self.show_kernel(0)
        self.has_witness, self.has_lines = len(scene.witness_faces) > 0, len(scene.surface_lines) > 0

    @property
    def window(self) -> Any:
        """The VTK render window."""
        return self._plotter.render_window

    def close(self) -> None:
        """Let VTK go."""
        self._plotter.close()

    def to_local(self, world: NDArray[np.float64]) -> NDArray[np.float64]:
        """World coordinates in the frame of the actors."""
        return (world - self._middle) / self.diagonal

    def to_world(self, local: NDArray[np.float64]) -> NDArray[np.float64]:
        """The inverse."""
        return self._middle + self.diagonal * local

    def show_kernel(self, stop: int) -> None:
        """Draw the kernel of a stop of the slider; each is made into triangles once."""
        self._kernel = stop
        if stop not in self._scenes:
            kernel = self.shown.kernels[stop]
            self._scenes[stop] = make_scene(self.shown.mesh, kernel, up=self.shown.up, resolution=_RESOLUTION)
        scene = self._scenes[stop]
        self._solid.prop.color, self._edges.prop.color = scene.kernel_color, scene.kernel_line_color
        points = scene.kernel_vertices
        if len(scene.kernel_faces):
            data = self._pv.PolyData.from_regular_faces(self.to_local(points), scene.kernel_faces)
        elif len(points) == 2:
            data = self._pv.Tube(*self.to_local(points), radius=0.006, n_sides=16)
        else:
            data = self._ball(points[0], 0.01) if len(points) else self._pv.PolyData()
        lines = scene.kernel_lines if len(scene.kernel_faces) and len(scene.kernel_lines) <= 4000 else points[:0]
        self._give(self._solid, self._clipped(data, closed=len(scene.kernel_faces) > 0))
        self._give(self._edges, self._clipped(self._segments(lines.reshape(-1, 2, 3))))

    def color(self, away: NDArray[np.bool_], hidden: NDArray[np.bool_]) -> None:
        """Colour triangles that the probe does not face red, and those that hide from it dark."""
        self._away, self._hidden = away, hidden
        self._recolor()

    def set_opacity(self, alpha: float) -> None:
        """How much of what is behind the surface is hidden by it, 0 to 1."""
        self._alpha = alpha
        self._recolor()

    def move_probe(self, local: NDArray[np.float64]) -> None:
        """Put the ball of the probe there."""
        self._probe.position = tuple(local)

    def show(self, *, lines: bool, witness: bool, guards: bool) -> None:
        """Show or hide what is drawn beside surface and kernel."""
        for actors, wanted in (([self._lines], lines), ([self._witness], witness), (self._guards, guards)):
            for actor in actors:
                self._wanted[actor] = wanted
                self._give(actor, actor.mapper.dataset)

    def cut(self, axis: int | None, share: float, *, other_side: bool) -> None:
        """Leave out what lies beyond a plane across a world axis, at that share of the box; None shows all."""
        if axis is None:
            self._plane = None
        else:
            normal = np.eye(3)[axis] * (-1.0 if other_side else 1.0)
            low, high = self.to_local(self.shown.mesh.bounds)
            self._plane = normal, low + share * (high - low)
        scene = self._scenes[0]
        self._give(self._surface, self._clipped(self._whole))
        self._give(self._lines, self._clipped(self._segments(scene.surface_lines)))
        if self._plane is None:
            self._give(self._rim, self._pv.PolyData())
        else:
            self._give(self._rim, self._whole.slice(normal=self._plane[0], origin=self._plane[1]))
        self._recolor()
        self.show_kernel(self._kernel)

    def _recolor(self) -> None:
        colors = np.empty((len(self._away), 4), np.uint8)
        colors[:] = [*rgb_of(SURFACE), round(255 * self._alpha)]
        colors[self._hidden] = [*rgb_of(HIDDEN), round(255 * max(self._alpha, 0.45))]
        colors[self._away] = [*rgb_of(WITNESS), round(255 * max(self._alpha, 0.85))]
        data = self._surface.mapper.dataset
        data.cell_data["rgba"] = colors[data.cell_data["triangle"]]
        data.Modified()

    def _add(self, data: Any, **style: Any) -> Any:
        if style.get("rgb"):
            data.cell_data["rgba"] = np.full((data.n_cells, 4), 255, np.uint8)
        actor = self._plotter.add_mesh(data if data.n_points else self._dot, reset_camera=False, **style)
        actor.SetVisibility(data.n_points > 0)
        return actor

    def _give(self, actor: Any, data: Any) -> None:
        """Show another data set; where there are no points, or they are not wanted, nothing."""
        actor.mapper.dataset = data if data.n_points else self._dot
        actor.SetVisibility(actor.mapper.dataset is not self._dot and self._wanted.get(actor, True))

    def _clipped(self, data: Any, *, closed: bool = False) -> Any:
        """Of a data set what lies on this side of the plane, with a lid where it is a solid."""
        if self._plane is None or data.n_points == 0:
            return data
        normal, origin = self._plane
        if closed and data.n_open_edges == 0:
            return data.clip_closed_surface(normal=-normal, origin=origin)
        return data.clip(normal=normal, origin=origin)

    def _ball(self, world: NDArray[np.float64], radius: float) -> Any:
        return self._pv.Sphere(radius=radius, center=tuple(self.to_local(world)))

    def _segments(self, lines: NDArray[np.float64]) -> Any:
        n = len(lines)
        cells = np.column_stack([np.full(n, 2), 2 * np.arange(n), 2 * np.arange(n) + 1]).ravel()
        return self._pv.PolyData(self.to_local(lines.reshape(-1, 3)), lines=cells) if n else self._pv.PolyData()

    def _witness_parts(self, scene: Scene) -> Any:
        """Of each facet of the proof a piece of its plane, and an arrow to its inner side."""
        parts: list[Any] = []
        for center, inward in zip(self.to_local(scene.witness_centers), scene.witness_inward, strict=True):
            above = center + 0.002 * inward  # not in the plane of the facet, where both would flicker
            parts.append(self._pv.Disc(center=above, inner=0.0, outer=0.05, normal=inward, r_res=1, c_res=40))
            parts.append(
                self._pv.Arrow(
                    start=center, direction=inward, scale=0.14, tip_length=0.3, tip_radius=0.09, shaft_radius=0.03
                )
            )
        return parts[0].append_polydata(*parts[1:]) if parts else self._pv.PolyData()

    @staticmethod
    def _used(
        vertices: NDArray[np.float64], faces: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        from voxkernel.mesh.triangles import without_strays

        return without_strays(vertices, faces)


_MATERIAL: dict[str, Any] = {"ambient": 0.35, "diffuse": 0.7, "specular": 0.15}
