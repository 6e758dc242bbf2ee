"""Packages that `pip install .` leaves out: which extra brings each, and the one place that imports them."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from voxkernel.errors import MissingExtraError

__all__ = ["EXTRAS", "check_installed", "optional"]

# By the name under which it is imported; pyproject.toml says the same of the names under which they are installed.
EXTRAS = {
    "aiohttp": "view",
    "blosc": "vdb",
    "cryptography": "datasets",
    "dask": "datasets",
    "distributed": "datasets",
    "fsspec": "datasets",
    "h5py": "labels",
    "jinja2": "datasets",
    "matplotlib": "pictures",
    "nibabel": "labels",
    "nrrd": "labels",
    "open3d": "registration",
    "PIL": "pictures",
    "plotly": "pictures",
    "pyarrow": "datasets",
    "pymeshlab": "repair",
    "pyvista": "pictures",
    "rich": "datasets",
    "tifffile": "labels",
    "trame": "view",
    "trame_client": "view",
    "trame_vtk": "view",
    "vtkmodules": "pictures",
    "zarr": "labels",
}


def optional(name: str) -> Any:
    """Import a package of an extra, or a module of it, such as ``"plotly.graph_objects"``; Open3D by `_open3d.open3d`.

    Raises
    ------
    MissingExtraError
        If the package is not installed; in one line that names the extra.
    """
    package = name.split(".")[0]
    try:
        import_module(package)
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name != package:  # something that the package itself needs
            raise
        raise _missing(package) from None


def check_installed(package: str) -> None:
    """Raise what `optional` would, without importing the package: before long work that will need it at its end."""
    if find_spec(package) is None:
        raise _missing(package)


def _missing(package: str) -> MissingExtraError:
    extra = EXTRAS[package]
    return MissingExtraError(
        f"`{package}` is not installed; the extra `{extra}` brings it: "
        f"`pip install \"voxkernel[{extra}]\"`, in a checkout `pip install \".[{extra}]\"`"
    )
