"""`Kernel`: what every kernel answers to, whichever way it is stored."""

from __future__ import annotations

import os
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel.halfspaces import Domain
from voxkernel.mesh import TriangleMesh

__all__ = ["Kernel"]


class Kernel(Protocol):
    """What `KernelPolytope` and `KernelGrid` have in common; write it where a function takes either.

    Attributes
    ----------
    dimension : int
        Of the exact kernel in the domain: -1 empty, 0 point, 1 segment, 2 flat polygon, 3 solid.
    is_empty : bool
        Whether it has no point, for certain.
    domain : Domain or None
        Where it was looked for; None means everywhere.
    volume : float
        Mesh units cubed.
    volume_bounds : (float, float)
        The volume lies between them.
    """

    @property
    def dimension(self) -> int:
        """Of the exact kernel in the domain."""
        ...

    @property
    def is_empty(self) -> bool:
        """Whether it has no point, for certain."""
        ...

    @property
    def domain(self) -> Domain | None:
        """Where it was looked for."""
        ...

    @property
    def volume(self) -> float:
        """Mesh units cubed."""
        ...

    @property
    def volume_bounds(self) -> tuple[float, float]:
        """The volume lies between them."""
        ...

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Tell which points (n, 3) lie inside, for certain."""
        ...

    def classify(self, points: ArrayLike) -> NDArray[np.int8]:
        """Give 1 where a point is inside, -1 where it is outside, both for certain, and 0 where that is undecided."""
        ...

    def to_points(self) -> NDArray[np.float64]:
        """Give points that stand for it, (n, 3): corners, or centres of voxels."""
        ...

    def to_mesh(self) -> TriangleMesh:
        """Give its surface."""
        ...

    def plot(self, surface: Any = None, **options: Any) -> Any:
        """Show it in the browser, with the surface that it is the kernel of."""
        ...

    def to_dict(self) -> dict[str, Any]:
        """Give what describes it as plain numbers and lists, ready for JSON."""
        ...

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write a file; the suffix picks the format."""
        ...
