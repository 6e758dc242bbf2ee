"""A label image in, one row per object out: is it star-convex, from where, and why not."""

from voxkernel.labels.image_files import is_label_file, read_labels
from voxkernel.labels.label_image import LabelImage
from voxkernel.labels.label_stars import label_stars
from voxkernel.labels.label_table import LabelStars
from voxkernel.labels.objects import LabelObjects, find_objects
from voxkernel.labels.painting import paint_labels, paint_seen
from voxkernel.labels.star_polyhedra import StarKernels, star_polyhedra_kernels
from voxkernel.labels.write_labels import check_target, write_labels

__all__ = [
    "LabelImage",
    "LabelObjects",
    "LabelStars",
    "StarKernels",
    "check_target",
    "find_objects",
    "is_label_file",
    "label_stars",
    "paint_labels",
    "paint_seen",
    "read_labels",
    "star_polyhedra_kernels",
    "write_labels",
]
