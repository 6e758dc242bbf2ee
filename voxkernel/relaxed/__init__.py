"""Half-spaces in, how much of the surface points do not face out, and the point that faces the most."""

from voxkernel.relaxed.violation import StarCenter, best_center, violation

__all__ = [
    "StarCenter",
    "best_center",
    "violation",
]
