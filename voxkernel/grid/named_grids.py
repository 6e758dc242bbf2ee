"""`NamedGrids`: what a result offers to be written as a file of grids."""

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from voxkernel.grid.sparse_grid import SparseGrid

__all__ = ["NamedGrids"]


@runtime_checkable
class NamedGrids(Protocol):
    """Grids by name and what they do not tell themselves, such as a `KernelGrid`."""

    def to_grids(self) -> Mapping[str, SparseGrid]:
        """The grids, in the order in which they are written."""
        ...

    def file_metadata(self) -> dict[str, Any]:
        """Metadata of the file, of types that a .vdb file has."""
        ...
