"""Surfaces in, inner half-spaces and their exact signs out.

Also where kernels are looked for (domains), and whether half-spaces have a common point, with a witness if not.
"""

from voxkernel.halfspaces.domain import Domain, ball_domain, box_domain, hull_domain, planes_domain
from voxkernel.halfspaces.feasibility import Feasibility, find_feasibility
from voxkernel.halfspaces.half_spaces import HalfSpaces
from voxkernel.halfspaces.witness import Witness

__all__ = [
    "Domain",
    "Feasibility",
    "HalfSpaces",
    "Witness",
    "ball_domain",
    "box_domain",
    "find_feasibility",
    "hull_domain",
    "planes_domain",
]
