"""Surfaces larger than memory in, what can matter of them out: chunks, passes over their planes, a deep point.

`exact` and the others finish on the planes that are kept.
"""

from voxkernel.large.stream_mesh import stream_mesh
from voxkernel.large.streamed_surface import StreamedSurface
from voxkernel.large.surface_reader import StreamProgress

__all__ = ["StreamProgress", "StreamedSurface", "stream_mesh"]
