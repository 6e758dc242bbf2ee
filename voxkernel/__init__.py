"""The surface kernel of 3D shapes: the points from which the whole surface can be seen."""

__version__ = "0.1.0"
