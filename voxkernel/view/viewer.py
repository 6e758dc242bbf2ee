"""`open_viewer`: a viewer in a process of its own, which ends with this one."""

from __future__ import annotations

import pickle
import subprocess
import sys
import tempfile
import warnings
import webbrowser
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

import voxkernel
from voxkernel._extras import check_installed
from voxkernel.errors import MissingExtraError, SolverError
from voxkernel.exact import Kernel
from voxkernel.guarding import Guards
from voxkernel.mesh import MeshLike
from voxkernel.view.loopback import free_port
from voxkernel.view.shown import Shown, gathered
from voxkernel.view.slider_page import write_slider_page

__all__ = ["Viewer", "instead_of_viewer", "missing_extra", "open_viewer"]


class Viewer:
    """A window in the browser on a surface and its kernels; a context manager that closes it.

    Attributes
    ----------
    url : str
        Where it is shown: an address on this machine only, or a file where the extra `view` is not installed.
    """

    def __init__(self, url: str, process: subprocess.Popen[bytes] | None) -> None:
        self.url = url
        self._process = process

    def __repr__(self) -> str:
        """Name the address."""
        return f"Viewer({self.url!r}, {'open' if self.is_open else 'closed'})"

    def _repr_html_(self) -> str:
        """The viewer within a notebook, as long as it is open."""
        if not self.is_open:
            return f"<p>{escape(repr(self))}</p>"
        return f'<iframe src="{escape(self.url)}" width="100%" height="640" style="border:0"></iframe>'

    def __enter__(self) -> Viewer:
        """Give itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    @property
    def is_open(self) -> bool:
        """Whether it still answers; a page in a file does not."""
        return self._process is not None and self._process.poll() is None

    def wait(self) -> None:
        """Wait until it is closed, or for an interrupt, which closes it: the last line of a script."""
        if self._process is not None:
            try:
                self._process.wait()
            finally:
                self.close()

    def close(self) -> None:
        """End the server; the page in the browser says so."""
        if self._process is None:
            return
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()  # the child ends with its input
        try:
            self._process.wait(timeout=5.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def open_viewer(
    surface: MeshLike,
    kernel: Kernel | None = None,
    *,
    tolerances: Sequence[float] | None = None,
    depth: int = 6,
    domain: Any = None,
    guards: Guards | None = None,
    title: str = "",
    up: ArrayLike | None = None,
    port: int = 0,
    browser: bool = True,
) -> Viewer:
    """Show a surface and its kernels in the browser, on this machine only, without a network.

    A slider goes from the exact kernel through relaxed ones that grow; a probe point can be dragged, and the facets
    that it does not face are red, those that hide from it dark; its violation, its clearance and what it sees (by rays,
    with Open3D) are told as numbers. Sections, the facets that prove that a kernel is empty, and guards are shown.

    Parameters
    ----------
    surface : mesh, path or (vertices, faces)
        Anything `as_mesh` takes.
    kernel : KernelPolytope or KernelGrid, optional
        What `exact_kernel` or `voxel_kernel` gave for it; computed by default.
    tolerances : sequence of float, optional
        Stops of the slider beside the exact kernel, shares of the area in [0, 1], from one traversal; by default up to
        0.2 above the smallest share that some point has turned away.
    depth : int
        Of the voxels of the relaxed kernels: 2**depth along the domain, 3 to 10.
    domain : {"ball", "hull", "box"}, Domain, HalfSpaces or (normals, offsets), optional
        Where kernels are looked for; that of `kernel` by default.
    guards : Guards, optional
        From `voxkernel.guards`.
    title : str
        Heading; the name of the file by default.
    up : (3,) array_like, optional
        The direction that points up, as in `surface_picture`.
    port : int
        Port on 127.0.0.1, 0 to 65535; 0 takes a free one.
    browser : bool
        Open the page in the browser.

    Returns
    -------
    Viewer
        Its server is a process of its own that ends with `close`, or with this process.

    Raises
    ------
    MeshError, MeshReadError, TypeError, ValueError
        If the surface or a number cannot be used, or the port is taken.
    SolverError
        If the server does not start.

    Notes
    -----
    Needs the extra `view`. Without it one warning says so, and a page with the same slider is written to a temporary
    file and opened instead (`slider_page`, which needs plotly).

    Examples
    --------
    >>> import voxkernel
    >>> from voxkernel.demo_shapes import urchin
    >>> with open_viewer(urchin(), tolerances=[0.05], depth=4, browser=False) as viewer:  # doctest: +SKIP
    ...     print(viewer.url)
    http://127.0.0.1:41753/f3Vq.../
    """
    number = free_port(port)
    missing = missing_extra()
    shown = gathered(
        surface, kernel, tolerances=tolerances, depth=depth, domain=domain, guards=guards, title=title, up=up
    )
    if missing is not None:
        place = Path(tempfile.mkdtemp(prefix="voxkernel-")) / "viewer.html"
        words = instead_of_viewer(missing, shown, place)
        warnings.warn(words, stacklevel=2)
        if browser:
            webbrowser.open(place.as_uri())
        return Viewer(place.as_uri(), None)
    return _started(shown, number, browser)


def missing_extra() -> MissingExtraError | None:
    """What hinders a viewer; raised where a page with a slider cannot be written either."""
    try:
        for package in ("trame", "trame_client", "trame_vtk", "aiohttp", "pyvista"):
            check_installed(package)
    except MissingExtraError as missing:
        try:
            check_installed("plotly")
        except MissingExtraError:
            raise missing from None
        return missing
    return None


def instead_of_viewer(missing: MissingExtraError, shown: Shown, place: Path) -> str:
    """Write the page with a slider, and say in one line why, and where it is."""
    write_slider_page(place, shown)
    return f"{missing}; instead of the viewer a page with the same slider is written to {place}"


def _started(shown: Shown, port: int, browser: bool) -> Viewer:
    code = (
        f"import sys; sys.path.insert(0, {str(Path(voxkernel.__file__).parents[1])!r}); "
        "from voxkernel.view.child import main; main()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(port), str(int(browser))], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    viewer = Viewer("", process)
    assert process.stdin is not None  # both are pipes
    assert process.stdout is not None
    try:
        pickle.dump(shown, process.stdin)
        process.stdin.flush()
        answer = process.stdout.readline().decode().strip()
    except BrokenPipeError:
        answer = ""
    except BaseException:
        viewer.close()
        raise
    if not answer.startswith("http"):
        viewer.close()
        raise SolverError(f"the viewer did not start: {answer or 'its process ended'}")
    viewer.url = answer
    return viewer
