"""`LabelStars`: one row per object of a label image."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel._frozen import Frozen

__all__ = ["LabelStars"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class LabelStars(Frozen):
    """Objects of a label image as star-shaped bodies: arrays with one row per object, read-only.

    Attributes
    ----------
    label, voxels : (n,) int64
        The object's number in the image and how many voxels it has.
    low, high : (n, axes) int64
        Its bounding box: the first voxel along each axis, and one behind the last.
    fragments, largest_fragment : (n,) int64
        Pieces that do not touch, not even by a corner, and voxels of the largest.
    holes, hole_voxels : (n,) int64
        Cavities (joined through faces, without a way out of them) and voxels in them.
    touches_border : (n,) bool
        Whether the object has a voxel at the border of the image, where it may go on.
    elongation : (n,) float64
        Largest over smallest standard deviation of its points, >= 1.
    visible, visible_upper : (n,) float64
        V*: the share of its voxels that its best voxel sees; and what no voxel can exceed. In (0, 1].
    center : (n, axes) int64
        The best voxel: of those that see most the deepest, of these the one nearest to the centroid.
    center_world : (n, axes) float64
        The same in world units, `center` times the spacing.
    visible_deepest, visible_centroid : (n,) float64
        V at the voxel farthest from the outside, and at the centroid cut to integers (0 where that is outside).
    n_rays : tuple of int
        Numbers of rays, one for each column of `iou`.
    iou, iou_stepped : (n, len(n_rays)) float64
        Intersection over union, in voxels, of the object and the body spanned by rays from `center`: rays that end
        where they leave the object, and at the first sample outside, as StarDist's.
    rays_for_80, rays_for_90 : (n,) int64
        The smallest of `n_rays` that brings `iou` to 0.8 and to 0.9; 0 where none does.
    reason : tuple of str
        The main cause why an object falls short: "fragment", "hole", "hidden part", "elongated", "" where none holds.
    detail : tuple of str
        Every cause that holds in words, with its share, the main one first; "" where none holds.
    defect_lower, defect_upper : (n,) float64
        Bounds on v*, the share of the smoothed surface that the best point does not face; NaN without `surface`.
    kernel_ratio : (n,) float64
        Volume of the surface's kernel over that inside the surface; NaN without `surface`.
    verdict : tuple of str
        Of `starshapeness`: "star-shaped", "degenerate" or "not star-shaped"; "" without `surface`, and where the
        object has no closed surface.
    spacing : tuple of float
        Of the image.

    Notes
    -----
    What the best voxel does not see is shared out, each voxel once: to *fragment* what is outside the largest
    fragment, to *hole* what would be seen if the holes were filled, to *hidden part* the rest. *elongated* is what rays
    lose besides. It is judged for every object, by the largest `iou` of the numbers of rays up to 96 (of all numbers
    where 96 is not among them): it holds where that is below 0.8 and, too, below 0.8 of `visible`, or farther below
    `visible` than `visible` is below 1. So where it holds, `rays_for_80` is 0 or more than 96, and of an object that is
    seen whole it holds exactly there. `reason` is the cause with the largest share, the difference to `visible` for
    *elongated*, of equal ones the first in the order above; but *elongated* comes last where less than 0.8 is
    visible, since no rays would do. And where `elongation` is below 2 and something is hidden, `detail` says that the
    rays are *too few from the best voxel*, last: 96 rays from the middle reach 0.8 of ellipsoids, rods and plates of
    that elongation, and the best voxel is elsewhere because of what is hidden.
    """

    label: NDArray[np.int64]
    voxels: NDArray[np.int64]
    low: NDArray[np.int64]
    high: NDArray[np.int64]
    fragments: NDArray[np.int64]
    largest_fragment: NDArray[np.int64]
    holes: NDArray[np.int64]
    hole_voxels: NDArray[np.int64]
    touches_border: NDArray[np.bool_]
    elongation: NDArray[np.float64]
    visible: NDArray[np.float64]
    visible_upper: NDArray[np.float64]
    center: NDArray[np.int64]
    center_world: NDArray[np.float64]
    visible_deepest: NDArray[np.float64]
    visible_centroid: NDArray[np.float64]
    n_rays: tuple[int, ...]
    iou: NDArray[np.float64]
    iou_stepped: NDArray[np.float64]
    rays_for_80: NDArray[np.int64]
    rays_for_90: NDArray[np.int64]
    reason: tuple[str, ...]
    detail: tuple[str, ...]
    defect_lower: NDArray[np.float64]
    defect_upper: NDArray[np.float64]
    kernel_ratio: NDArray[np.float64]
    verdict: tuple[str, ...]
    spacing: tuple[float, ...]

    def __len__(self) -> int:
        """Return the number of objects."""
        return len(self.label)

    def __repr__(self) -> str:
        """Count the objects and those that are star-convex."""
        stars = int(np.sum(self.visible == 1.0))
        return f"LabelStars({len(self)} objects, {stars} star-convex, {len(self) - stars} not or not known to be)"

    @property
    def is_certified(self) -> NDArray[np.bool_]:
        """Whether V* is known exactly, (n,): the bounds meet."""
        return self.visible == self.visible_upper

    def to_dict(self) -> dict[str, list[Any]]:
        """Give the columns of a table: one number or text each, axes and numbers of rays in the names.

        Returns
        -------
        dict of str to list
            As `center_0`, `iou_96`, `iou_stepped_96`; None where a number is not known.
        """
        return {
            name: list(column) if isinstance(column, tuple) else [None if v != v else v for v in column.tolist()]
            for name, column in self._columns()
        }

    def to_arrow(self) -> Any:
        """Give the columns of `to_dict` as a table.

        Returns
        -------
        pyarrow.Table
            One row per object; the types of its columns are those above, whatever the rows hold, so that tables can
            be put together: `pyarrow.concat_tables`, with `promote_options="default"` for other axes or `n_rays`.

        Raises
        ------
        MissingExtraError
            If pyarrow is not installed.
        """
        pa = optional("pyarrow")
        rows = self.to_dict()
        types = {
            name: pa.string() if isinstance(column, tuple) else pa.from_numpy_dtype(column.dtype)
            for name, column in self._columns()
        }
        return pa.table({name: pa.array(rows[name], types[name]) for name in rows})

    def to_pandas(self) -> Any:
        """Give the columns of `to_dict` as a data frame, where pandas is installed.

        Returns
        -------
        pandas.DataFrame
            One row per object.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        import pandas as pd  # pyright: ignore

        return pd.DataFrame(self.to_dict())

    def _columns(self) -> Iterator[tuple[str, NDArray[Any] | tuple[str, ...]]]:
        """Columns of numbers as arrays, of text as tuples."""
        for name in (
            "label", "voxels", "low", "high", "fragments", "largest_fragment", "holes", "hole_voxels", "touches_border",
            "elongation", "visible", "visible_upper", "is_certified", "center", "center_world", "visible_deepest",
            "visible_centroid", "iou", "iou_stepped", "rays_for_80", "rays_for_90", "reason", "detail", "defect_lower",
            "defect_upper", "kernel_ratio", "verdict",
        ):  # fmt: skip
            value = getattr(self, name)
            if isinstance(value, tuple) or value.ndim == 1:
                yield name, value
            else:
                ends = self.n_rays if name.startswith("iou") else range(value.shape[1])
                yield from ((f"{name}_{end}", value[:, k]) for k, end in enumerate(ends))
