"""What a viewer shows: a surface, its kernel, relaxed kernels from one traversal, guards."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_depth, as_each, as_share
from voxkernel._frozen import Frozen
from voxkernel.exact import Kernel, exact_kernel
from voxkernel.guarding import Guards
from voxkernel.mesh import MeshLike, TriangleMesh, as_mesh
from voxkernel.pictures.camera import as_up
from voxkernel.pictures.scene import caption_of
from voxkernel.relaxed import StarCenter, best_center
from voxkernel.voxels import KernelGrid, voxel_kernels

__all__ = ["MARGINS", "Shown", "gathered"]

MARGINS = (0.0025, 0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2)
"""Tolerances of the slider by default: so much above the smallest share of the area that some point has turned away."""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Shown(Frozen):
    """`kernels` are the stops of the slider: the exact kernel first, then relaxed ones by rising tolerance."""

    mesh: TriangleMesh
    kernels: tuple[Kernel, ...]
    center: StarCenter
    guards: Guards | None
    title: str
    up: NDArray[np.float64] | None  # what points up, a unit vector; None leaves it to the picture

    @property
    def start(self) -> tuple[float, float, float]:
        """Where the probe begins: the deepest point of the exact kernel, or the star centre."""
        deepest = getattr(self.kernels[0], "deepest_point", None)
        x, y, z = (self.center.point if deepest is None or self.kernels[0].is_empty else deepest).tolist()
        return x, y, z

    def stop_name(self, stop: int) -> str:
        """What a stop of the slider is called."""
        share = tolerance_of(self.kernels[stop])
        return f"relaxed, up to {100 * share:.4g} % of the area turned away" if share else "exact kernel"

    def stop_words(self, stop: int) -> str:
        """Verdict and volume at a stop of the slider."""
        return caption_of(self.mesh, self.kernels[stop]).replace("red facets", "facets of the proof")


def tolerance_of(kernel: Kernel) -> float:
    """The share of the area that points of a kernel may have turned away."""
    return float(getattr(kernel, "tolerance", 0.0))


def gathered(
    surface: MeshLike, kernel: Kernel | None, *, tolerances: Sequence[float] | None, depth: int, domain: Any,
    guards: Guards | None, title: str, up: ArrayLike | None = None,
) -> Shown:  # fmt: skip
    """Compute what is missing; `kernel` may be exact, relaxed or None."""
    upward = as_up(up)
    mesh = as_mesh(surface)
    steps = as_depth("depth", depth, 3, 10)
    if domain is None and kernel is not None:
        domain = kernel.domain
    exact = kernel if kernel is not None and not tolerance_of(kernel) else exact_kernel(mesh, domain=domain)
    center = best_center(mesh, domain=domain)
    if tolerances is None:
        least = center.violation_bounds[1]
        shares = [least + m for m in MARGINS if least + m < 1.0]
    else:
        shares = sorted({v for v in as_each("tolerances", tolerances, as_share) if v > 0.0})
    relaxed: list[KernelGrid] = []
    if shares:
        relaxed += voxel_kernels(mesh, tolerances=shares, depth=steps, domain=domain)
    if isinstance(kernel, KernelGrid) and kernel.tolerance:
        relaxed = sorted([kernel, *(k for k in relaxed if k.tolerance != kernel.tolerance)], key=tolerance_of)
    return Shown(mesh, (exact, *relaxed), center, guards, title or _name(mesh.source), upward)


def _name(source: str) -> str:
    return "surface" if source in ("", "arrays") else Path(source).name
