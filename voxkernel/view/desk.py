"""The picture and its controls as a trame application: what the browser changes, and what is told in return."""

from __future__ import annotations

from math import floor, log10
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.pictures.scene import KERNEL, RELAXED, SURFACE, WITNESS
from voxkernel.view.probe import Facing, Probe, Sight
from voxkernel.view.shown import Shown
from voxkernel.view.stage import HIDDEN, PROOF, Stage

__all__ = ["Desk"]

_CLIENT = Path(__file__).parent / "client"
_AXES = {"x": 0, "y": 1, "z": 2}
_RING = '<button id="vk-probe" type="button" aria-label="probe: drag it, or use arrow and page keys"></button>'


class Desk:
    """Hold one viewer's state; `server` is a trame server that has not been started."""

    def __init__(self, server: Any, shown: Shown) -> None:
        self._server, self.shown = server, shown
        self._probe, self._stage = Probe(shown.mesh), Stage(shown)
        self._point = np.array(shown.start)
        self._facing: Facing = self._probe.facing(self._point)
        self._sight: Sight | None = None
        self._digits = 5 - floor(log10(self._stage.diagonal))
        self._done: dict[str, Any] = {}  # settings as they are drawn
        self._fill_state()
        self._build()
        self._connect()
        self._tell()  # rays are cast when the first browser is there: Open3D takes seconds to import
        self._done |= {
            "stop": 0, "rays": True, "opacity": 0.4, "show": (True, True, True), "section": ("", 0.5, False),
        }  # fmt: skip

    def close(self) -> None:
        """Let VTK go."""
        self._stage.close()

    def _fill_state(self) -> None:
        shown = self.shown
        found = shown.guards
        legend = [(SURFACE, "surface"), (KERNEL, "kernel"), (RELAXED, "relaxed kernel")]
        legend += [(WITNESS, "turned away from the probe"), (HIDDEN, "hidden from it behind other facets")]
        if self._stage.has_witness:
            legend.append((PROOF, "facets of the proof, each with its inner side"))
        self._server.state.update(
            {
                "trame__title": f"{shown.title} - voxkernel", "title": shown.title, "stop": 0,
                "last_stop": len(shown.kernels) - 1, "stop_name": shown.stop_name(0), "stop_words": shown.stop_words(0),
                "verdict": _verdict(shown), "rays": True, "axis": "", "share": 0.5, "other_side": False, "opacity": 0.4,
                "lines": True, "witness": True, "guards": True, "has_witness": self._stage.has_witness,
                "has_lines": self._stage.has_lines, "has_deepest": not shown.kernels[0].is_empty, "legend": legend,
                "guards_text": "" if found is None else f"{len(found)} guards see {100 * found.seen:.4g} % of the area",
            }
        )  # fmt: skip

    def _build(self) -> None:
        server = self._server
        server.enable_module(
            {"serve": {"voxkernel": str(_CLIENT)}, "scripts": ["voxkernel/view.js"], "styles": ["voxkernel/view.css"]}
        )
        html, vtk = optional("trame.widgets.html"), optional("trame.widgets.vtk")
        with optional("trame.ui.html").DivLayout(server) as layout:
            layout.root.set_text("")
            with html.Div(id="vk"):
                with html.Div(id="vk-picture") as picture:
                    self._view = vtk.VtkLocalView(self._stage.window, ref="view")
                    picture.add_child(_RING)
                with html.Div(id="vk-panel") as panel:
                    panel.add_child((_CLIENT / "panel.html").read_text(encoding="utf-8"))

    def _push(self, *, settled: bool = True) -> None:
        """Tell browsers what has changed; those that come later get the whole, which waits for the end of a drag."""
        if settled:
            self._view.update()
        elif self._server.protocol:
            changes = self._view.module.scene(self._stage.window, new_state=False, widgets=[], orientation_axis=0)
            self._server.protocol.publish("trame.vtk.delta", changes)

    def _connect(self) -> None:
        state, control = self._server.state, self._server.controller
        state.change("stop")(self._on_stop)
        state.change("rays")(self._on_rays)
        state.change("axis", "share", "other_side")(self._on_section)
        state.change("opacity")(self._on_opacity)
        state.change("lines", "witness", "guards")(self._on_show)
        control.trigger("probe")(self._on_probe)
        control.trigger("place")(self._on_place)
        control.trigger("begin")(self._on_begin)
        control.trigger("to_center")(lambda: self._move(self.shown.center.point, settled=True))
        control.trigger("to_deepest")(lambda: self._move(np.array(self.shown.start), settled=True))

    def _is_new(self, name: str, value: Any) -> bool:
        """Whether a setting differs from what is drawn; all are reported once when the server starts."""
        before = self._done.get(name)
        self._done[name] = value
        return value != before

    def _on_stop(self, stop: Any, **_: Any) -> None:
        chosen = min(max(int(stop), 0), len(self.shown.kernels) - 1)
        if self._is_new("stop", chosen):
            state = self._server.state
            state.stop_name, state.stop_words = self.shown.stop_name(chosen), self.shown.stop_words(chosen)
            self._stage.show_kernel(chosen)
            self._push()

    def _on_rays(self, rays: Any, **_: Any) -> None:
        if self._is_new("rays", bool(rays)):
            self._settle()
            self._push()

    def _on_section(self, axis: Any, share: Any, other_side: Any, **_: Any) -> None:
        wanted = str(axis), min(max(float(share), 0.0), 1.0), bool(other_side)
        if self._is_new("section", wanted):
            self._stage.cut(_AXES.get(wanted[0]), wanted[1], other_side=wanted[2])
            self._push()

    def _on_opacity(self, opacity: Any, **_: Any) -> None:
        wanted = min(max(float(opacity), 0.0), 1.0)
        if self._is_new("opacity", wanted):
            self._stage.set_opacity(wanted)
            self._push()

    def _on_show(self, lines: Any, witness: Any, guards: Any, **_: Any) -> None:
        wanted = bool(lines), bool(witness), bool(guards)
        if self._is_new("show", wanted):
            self._stage.show(lines=wanted[0], witness=wanted[1], guards=wanted[2])
            self._push()

    def _on_probe(self, local: Any, settled: Any) -> None:
        """Move to a point in the frame of the picture."""
        self._move(self._stage.to_world(np.array(local, dtype=np.float64)), settled=bool(settled))

    def _on_begin(self) -> None:
        if self._sight is None:
            self._settle()
            self._push()

    def _on_place(self, axis: Any, value: Any) -> None:
        """Move to a typed coordinate."""
        point = self._point.copy()
        point[int(axis)] = float(value)
        self._move(point, settled=True)

    def _move(self, point: NDArray[np.float64], *, settled: bool) -> None:
        if point.shape == (3,) and np.isfinite(point).all():
            self._point = point
            self._facing, self._sight = self._probe.facing(point), None
        if settled:
            self._settle()
        else:
            self._tell()
        self._push(settled=settled)

    def _settle(self) -> None:
        """Cast rays, once the probe is let go."""
        self._sight = self._probe.sight(self._point, self._facing.away) if self._server.state.rays else None
        self._tell()

    def _tell(self) -> None:
        state, facing, sight = self._server.state, self._facing, self._sight
        hidden = np.zeros(len(facing.away), bool) if sight is None else sight.hidden
        local = self._stage.to_local(self._point)
        self._stage.color(facing.away, hidden)
        self._stage.move_probe(local)
        state.probe = local.tolist()
        state.point_text = [round(v, self._digits) + 0.0 for v in self._point.tolist()]
        n = int(facing.away.sum())
        state.violation_text = f"{100 * facing.violation:.4g} % of the area ({n:,} triangles)"
        state.clearance_text = f"{facing.clearance:.4g} mesh units"
        if sight is not None:
            seen = sight.seen
            state.seen_text = f"{100 * seen.fraction:.4g} % of the area" + (
                f" ± {100 * seen.error:.2g}" if seen.error else ""
            )
        elif not state.rays:
            state.seen_text = "no rays cast"
        else:
            state.seen_text = "…" if self._probe.has_rays else "Open3D casts the rays: the extra registration brings it"


def _verdict(shown: Shown) -> str:
    words = shown.stop_words(0)
    if shown.kernels[0].is_empty:
        words += f"; the star centre has {100 * shown.center.violation_bounds[1]:.4g} % turned away"
    return f"{shown.mesh.n_facets:,} facets; {words}"
