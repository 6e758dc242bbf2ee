"""What an evaluation computes and how it runs."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Any, Literal

from voxkernel._checks import as_choice, as_depth, as_each, as_positive, as_share
from voxkernel._extras import optional
from voxkernel._fork_server import FEW
from voxkernel._notebook import InNotebooks
from voxkernel._plain import json_text
from voxkernel.labels.label_stars import as_ray_counts

__all__ = [
    "FEW", "PROFILE_TOLERANCES", "EvaluateSettings", "for_files", "settings_hash", "settings_text", "versions_text",
]  # fmt: skip

PROFILE_TOLERANCES = tuple(round(0.02 * k, 2) for k in range(26))
_FORMAT = 3  # counts up when the same settings give other rows
_RESULTS = (
    *("domain", "gap", "depth", "tolerances", "visible", "energies", "thumbnails", "spacing", "n_rays", "surface"),
    "guards",
)


@dataclass(frozen=True, slots=True)
class EvaluateSettings(InNotebooks):
    """Settings of `voxkernel.evaluate`.

    The first ten and `guards` decide what is in a row: rows made with others are computed again. The rest may
    change from one run to the next.

    Parameters
    ----------
    domain : {"ball", "hull", "box"}, optional
        Where kernels are looked for, as for `starshapeness`.
    gap : float
        Largest distance of the bounds on the smallest violation, > 0.
    depth : int
        2**depth voxels along the domain for the defect profile and for relaxed kernels in pictures, 3 to 12.
    tolerances : sequence of float
        Of the defect profile: shares of the surface, in [0, 1]. `PROFILE_TOLERANCES` are 0, 0.02, ... 0.5.
    visible : bool
        Cast rays: how much is really visible from the star centre.
    energies : int, optional
        Largest degree of spherical-harmonic energies about the star centre, 0 to 256; None leaves them out.
    thumbnails : bool, optional
        Draw each surface with its kernel, 240 x 180 pixels. None: where the packages are installed, surfaces of runs of
        at most 200 files, and objects of label images of at most as many objects.
    spacing : sequence of float, optional
        Of label images: distance of voxel centres along each axis; by default what a file stores.
    n_rays : sequence of int
        Of label images: numbers of rays to try, as `label_stars`.
    surface : bool
        Of label images: also measure a smoothed surface of each object.
    label_images : bool
        Take label images of folders and globs, too; those that are named are always taken.
    views : int or "all"
        How many surfaces, the first ones by name, get a simplified copy to turn in a report.
    timeout : float, optional
        Seconds a mesh, or an object of a label image, may take before its worker is killed; None waits for ever.
    memory_limit : int or str, optional
        Memory of one worker, bytes or such as "4GB"; by default its share of 90 % of the machine's. A surface that
        needs more fails, and its row says so in a line.
    workers : int, optional
        Processes of the local cluster; by default as many as give each core a thread.
    scheduler : str, optional
        Address of a Dask scheduler to use instead, such as "tcp://10.0.0.1:8786".
    retry_failed : bool
        Try again what failed in an earlier run.
    rehash : bool
        Read and hash every file of an earlier run again, also those whose size, times and inode are as they were.
    csv : bool
        Write `rows.csv` as well.
    guards : float, optional
        Share of the area that guards shall see, in (0, 1]; None leaves them out.
    threads : int
        Threads of one worker, 1 to 256: for few and large surfaces. Rows are the same with any number.

    Raises
    ------
    ValueError, TypeError
        If a value cannot be used.

    Examples
    --------
    >>> EvaluateSettings(tolerances=PROFILE_TOLERANCES, thumbnails=True, timeout=60).depth
    6
    """

    domain: Literal["ball", "hull", "box"] | None = None
    gap: float = 1e-4
    depth: int = 6
    tolerances: Sequence[float] = (0.01, 0.03, 0.1)
    visible: bool = False
    energies: int | None = None
    thumbnails: bool | None = False
    spacing: Sequence[float] | None = None
    n_rays: Sequence[int] = (32, 64, 96, 128, 256)
    surface: bool = False
    label_images: bool = False
    views: int | Literal["all"] = 0
    timeout: float | None = 300.0
    memory_limit: int | str | None = None
    workers: int | None = None
    scheduler: str | None = None
    retry_failed: bool = False
    csv: bool = False
    guards: float | None = None
    threads: int = 1
    rehash: bool = False

    def __post_init__(self) -> None:
        """Check every value before anything is computed."""
        if self.domain is not None:
            as_choice("domain", self.domain, ("ball", "hull", "box"))
        as_positive("gap", self.gap)
        as_depth("depth", self.depth, 3, 12)
        object.__setattr__(self, "tolerances", as_each("tolerances", self.tolerances, as_share))
        if self.energies is not None:
            as_depth("energies", self.energies, 0, 256)
        if self.spacing is not None:
            object.__setattr__(self, "spacing", as_each("spacing", self.spacing, as_positive))
        object.__setattr__(self, "n_rays", as_ray_counts(self.n_rays, 3))
        if self.guards is not None and not 0.0 < as_share("guards", self.guards):
            raise ValueError(f"`guards` must be in (0, 1]; got {self.guards:g}")
        if self.views != "all":
            as_depth("views", self.views, 0, 2**31)
        if self.timeout is not None:
            as_positive("timeout", self.timeout)
        if self.workers is not None:
            as_depth("workers", self.workers, 1, 4096)
        as_depth("threads", self.threads, 1, 256)
        self.memory_bytes()

    def memory_bytes(self) -> int | None:
        """Give the memory limit in bytes; None where none was given."""
        if self.memory_limit is None:
            return None
        parse_bytes = optional("dask.utils").parse_bytes
        try:
            limit = int(parse_bytes(self.memory_limit))
        except (ValueError, TypeError):
            raise ValueError(f"`memory_limit` must be bytes, or such as '4GB'; got {self.memory_limit!r}") from None
        if limit < 2**28:
            raise ValueError(f"`memory_limit` must be at least 256 MiB; got {self.memory_limit!r}")
        return limit

    def of_results(self) -> dict[str, Any]:
        """Give the settings that decide what is in a row."""
        values = {name: getattr(self, name) for name in _RESULTS}
        values["thumbnails"] = bool(self.thumbnails)  # rows with pictures nobody asked for are rows without them
        if self.guards is None:  # as runs without guards have it
            del values["guards"]
        spacing = None if self.spacing is None else list(self.spacing)
        return {**values, "tolerances": list(self.tolerances), "n_rays": list(self.n_rays), "spacing": spacing}


def for_files(settings: EvaluateSettings, n: int) -> EvaluateSettings:
    """Decide whether pictures are drawn of so many files, where that was left open."""
    if settings.thumbnails is None and (n > FEW or not all(find_spec(package) for package in ("pyvista", "PIL"))):
        return replace(settings, thumbnails=False)
    return settings


def settings_text(settings: EvaluateSettings) -> str:
    """Write the settings that decide what is in a row as JSON."""
    return json_text(settings.of_results(), sort_keys=True)


def settings_hash(settings: EvaluateSettings) -> str:
    """Name these settings, for this version of the library."""
    from voxkernel._version import __version__

    text = json_text([_FORMAT, __version__, settings_text(settings)])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def versions_text() -> str:
    """Write the versions that a result may depend on as JSON."""
    from importlib.metadata import PackageNotFoundError, version
    from platform import python_version

    from voxkernel._version import __version__

    found = {"voxkernel": __version__, "python": python_version()}
    for name in ("numpy", "scipy", "open3d-cpu", "open3d", "pymeshlab"):
        try:
            found[name.removesuffix("-cpu")] = version(name)
        except PackageNotFoundError:
            continue
    return json_text(found, sort_keys=True)
