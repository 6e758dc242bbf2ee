"""An object of a label image: three projections and its surface, what is hidden in red, the best centre marked."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.errors import VoxKernelError
from voxkernel.labels import LabelImage, LabelStars
from voxkernel.labels.label_surface import surface_of
from voxkernel.labels.objects import LabelObjects, crop_of
from voxkernel.labels.painting import CENTER, HIDDEN, seen_from
from voxkernel.pictures.silent_vtk import silent_vtk

__all__ = ["label_picture", "object_picture"]

_PANEL = (240, 180)  # of the four, in pixels
_SEEN, _HIDDEN, _MARK, _INK = (70, 118, 172), (204, 52, 40), (250, 200, 20), (86, 100, 115)
_LEFT = 0.1  # of the voxels' volume that a surface must have to be drawn
_TOO_THIN = "Too thin for\na smoothed surface"


def label_picture(image: LabelImage, stars: LabelStars, i: int) -> bytes:
    """Draw row `i` as a PNG: along each axis how much is behind a pixel, and the surface of an object of three axes.

    Where smoothing leaves next to nothing of a thin object, words stand in the place of the surface.
    """
    objects = LabelObjects(label=stars.label, voxels=stars.voxels, low=stars.low, high=stars.high)
    return object_picture(image, objects, stars.center, i)


def object_picture(image: LabelImage, objects: LabelObjects, center: NDArray[np.int64], i: int) -> bytes:
    """Draw one of some objects, each of which is seen best from its row of `center`."""
    pil = optional("PIL.Image")
    crop = crop_of(image, objects, i)
    seen = seen_from(crop, center[i], objects.low[i], is_flat=image.is_flat)
    page = pil.new("RGB", (2 * _PANEL[0], 2 * _PANEL[1]), (255, 255, 255))
    spacing = (1.0, *image.spacing) if image.is_flat else image.spacing
    for k, axis in enumerate((0,) if image.is_flat else (0, 1, 2)):
        across = [a for a in range(3) if a != axis]
        panel = _fitted(pil, _projection(seen, axis), (spacing[across[0]], spacing[across[1]]))
        at = (np.argwhere((seen == CENTER).any(axis=axis))[0] + 0.5) / np.array([seen.shape[a] for a in across])
        _mark(panel, at[1] * panel.width, at[0] * panel.height)
        page.paste(panel, ((k % 2) * _PANEL[0] + (_PANEL[0] - panel.width) // 2,
                           (k // 2) * _PANEL[1] + (_PANEL[1] - panel.height) // 2))  # fmt: skip
    if not image.is_flat:
        page.paste(_surface(pil, crop, seen, spacing), (_PANEL[0], _PANEL[1]))
    stream = io.BytesIO()
    page.save(stream, format="PNG", optimize=True)
    return stream.getvalue()


def _projection(seen: NDArray[np.uint8], axis: int) -> NDArray[np.uint8]:
    """Colours of one view: the more voxels behind a pixel the darker, the share of hidden ones turns it red."""
    depth = (seen != 0).sum(axis=axis).astype(float)
    hidden = (seen == HIDDEN).sum(axis=axis) / np.maximum(depth, 1)
    strength = (0.35 + 0.65 * depth / max(depth.max(), 1.0))[..., None] * (depth > 0)[..., None]
    colour = np.array(_SEEN) * (1 - hidden[..., None]) + np.array(_HIDDEN) * hidden[..., None]
    picture = 255 - strength * (255 - colour)
    return picture.round().astype(np.uint8)


def _fitted(pil: Any, picture: NDArray[np.uint8], spacing: tuple[float, float]) -> Any:
    """Scale a view to its panel, in the proportions of the world."""
    height, width = picture.shape[0] * spacing[0], picture.shape[1] * spacing[1]
    scale = min((_PANEL[0] - 8) / width, (_PANEL[1] - 8) / height)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    return pil.fromarray(picture).resize(size, pil.Resampling.NEAREST)


def _mark(panel: Any, x: float, y: float) -> None:
    """Put a disc where the best centre is."""
    optional("PIL.ImageDraw").Draw(panel).ellipse((x - 4, y - 4, x + 4, y + 4), fill=_MARK, outline=(30, 40, 50))


def _surface(pil: Any, crop: NDArray[np.uint8], seen: NDArray[np.uint8], spacing: tuple[float, ...]) -> Any:
    pyvista = optional("pyvista")
    first, second, third = spacing
    try:
        mesh = surface_of(crop, (first, second, third))
    except VoxKernelError:  # a voxel or two shrink to a surface without volume
        return _words(pil, _TOO_THIN)
    if mesh.facts().volume < _LEFT * np.count_nonzero(crop) * first * second * third:
        return _words(pil, _TOO_THIN)
    poly = mesh.to_polydata()
    at = np.clip(np.rint(mesh.vertices / np.array(spacing)).astype(np.int64), 1, np.array(crop.shape) - 2)
    near = np.stack([seen[tuple((at + step).T)] for step in _NEAR])  # the surface runs between voxels
    is_hidden = (near == HIDDEN).any(axis=0) & ~(near > HIDDEN).any(axis=0)
    poly.point_data["colour"] = np.where(is_hidden[:, None], np.array(_HIDDEN), np.array(_SEEN)).astype(np.uint8)
    with silent_vtk():
        plotter: Any = pyvista.Plotter(off_screen=True, window_size=list(_PANEL))
        try:
            plotter.set_background("white")
            plotter.add_mesh(poly, scalars="colour", rgb=True, smooth_shading=False)
            plotter.view_isometric()
            picture = np.asarray(plotter.screenshot(None, return_img=True))[..., :3]
            x, y = _place(plotter, np.argwhere(seen == CENTER)[0] * np.array(spacing))
        finally:
            plotter.close()
    panel = pil.fromarray(picture)
    _mark(panel, x, y)
    return panel


def _place(plotter: Any, point: NDArray[np.float64]) -> tuple[float, float]:
    """Where a point of the world is in the picture, in pixels from its upper left."""
    plotter.renderer.SetWorldPoint(*point.tolist(), 1.0)
    plotter.renderer.WorldToDisplay()
    at: Any = plotter.renderer.GetDisplayPoint()
    return at[0], _PANEL[1] - at[1]


def _words(pil: Any, words: str) -> Any:
    """A panel with words in its middle."""
    panel = pil.new("RGB", _PANEL, (255, 255, 255))
    middle = (_PANEL[0] / 2, _PANEL[1] / 2)
    draw = optional("PIL.ImageDraw").Draw(panel)
    draw.multiline_text(middle, words, fill=_INK, anchor="mm", align="center", font_size=14)
    return panel


_NEAR = np.array([(0, 0, 0), (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])
