"""The one place that imports Open3D, and what a bare Linux needs for that."""

import ctypes
import importlib
import sys
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional

__all__ = ["open3d", "open3d_mesh", "ray_scene"]

_LIBUSB = "libusb-1.0.so.0"


def _preload_libusb() -> None:
    """Put libusb into the process: Open3D 0.20 is linked to it, and a bare Debian does not have it.

    The dynamic linker takes a library that is already loaded under the wanted name, so the copy in the
    PyPI package `libusb-package` serves where the system has none. Nothing is done, and nothing raised,
    where neither is there: Open3D may not need it, and says so itself if it does.
    """
    try:
        ctypes.CDLL(_LIBUSB, mode=ctypes.RTLD_GLOBAL)
        return
    except OSError:
        pass
    try:
        path = importlib.import_module("libusb_package").get_library_path()
        if path is not None:
            ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    except (ImportError, OSError):
        return


def open3d() -> Any:
    """Import Open3D (2 to 5 s the first time) and return the module.

    Returns
    -------
    module
        `open3d`.

    Raises
    ------
    ImportError
        If Open3D is not installed (`MissingExtraError`) or a system library it needs is missing.
    """
    loaded = sys.modules.get("open3d")
    if loaded is not None:
        return loaded
    if sys.platform == "linux":
        _preload_libusb()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return optional("open3d")
    except OSError as error:
        hint = "`pip install libusb-package` may help"
        raise ImportError(f"open3d cannot be loaded: {error} ({hint})") from error


def open3d_mesh(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Any:
    """Copy triangles into an `open3d.geometry.TriangleMesh`; it refuses arrays that are read-only."""
    library = open3d()
    return library.geometry.TriangleMesh(
        library.utility.Vector3dVector(vertices.copy()), library.utility.Vector3iVector(faces.astype(np.int32))
    )


def ray_scene(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Any:
    """Put triangles into an `open3d.t.geometry.RaycastingScene`: for rays and nearest points, in single precision.

    Give vertices near the origin and of size about 1.
    """
    library = open3d()
    scene = library.t.geometry.RaycastingScene()
    tensor = library.core.Tensor
    scene.add_triangles(tensor(vertices.astype(np.float32)), tensor(faces.astype(np.uint32)))
    return scene
