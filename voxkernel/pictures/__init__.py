"""Surfaces and results in, PNG files and offline HTML pages out."""

from voxkernel.pictures.cells_picture import cells_picture
from voxkernel.pictures.guards_picture import guards_picture
from voxkernel.pictures.level_surface import level_surface
from voxkernel.pictures.registration_picture import registration_picture
from voxkernel.pictures.sphere_picture import sphere_picture
from voxkernel.pictures.surface_picture import interactive_page, surface_picture
from voxkernel.pictures.together_picture import together_picture

__all__ = [
    "cells_picture",
    "guards_picture",
    "interactive_page",
    "level_surface",
    "registration_picture",
    "sphere_picture",
    "surface_picture",
    "together_picture",
]
