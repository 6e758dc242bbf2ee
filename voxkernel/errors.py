"""The exceptions voxkernel raises on purpose."""

__all__ = ["GridReadError", "MeshError", "MeshReadError", "MissingExtraError", "SolverError", "VoxKernelError"]


class VoxKernelError(Exception):
    """Base class of every error voxkernel raises on purpose."""


class GridReadError(VoxKernelError, OSError):
    """A .vdb or .npz grid file that is missing, damaged, or not such a file."""


class MeshError(VoxKernelError, ValueError):
    """A surface that cannot be used: wrong shape, bad index, NaN, no area."""


class MeshReadError(VoxKernelError, OSError):
    """A mesh file that is missing, empty or not readable."""


class MissingExtraError(VoxKernelError, ImportError):
    """A package is needed that only an extra of the installation brings."""


class SolverError(VoxKernelError, RuntimeError):
    """A computation that could not be finished."""
