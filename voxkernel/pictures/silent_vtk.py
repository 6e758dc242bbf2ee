"""Keep VTK quiet while it draws."""

from __future__ import annotations

import contextlib
from collections.abc import Generator

from voxkernel._extras import optional

__all__ = ["silent_vtk"]


@contextlib.contextmanager
def silent_vtk() -> Generator[None]:
    """Keep VTK's search for a display off stderr while drawing."""
    core = optional("vtkmodules.vtkCommonCore")
    vtkLogger, vtkObject = core.vtkLogger, core.vtkObject
    level, warns = vtkLogger.GetCurrentVerbosityCutoff(), vtkObject.GetGlobalWarningDisplay()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    vtkObject.GlobalWarningDisplayOff()
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(level)
        vtkObject.SetGlobalWarningDisplay(warns)
