"""A scene -> PNG: PyVista draws off screen, Pillow writes the words."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel._palette import INK, PALE
from voxkernel.pictures.camera import camera_frame, look_at
from voxkernel.pictures.creases import SHARP_DEG
from voxkernel.pictures.furniture import add_furniture, legend_of
from voxkernel.pictures.scene import CENTER, DOMAIN, LINE, SURFACE, WITNESS, Scene
from voxkernel.pictures.silent_vtk import silent_vtk

__all__ = ["broken", "segments", "write_png"]

# Drawn larger and scaled down: smooth edges also where depth peeling forbids multi-sampling.
_SUPERSAMPLE = 1.5
# Place in the camera's frame (right, up, towards it) and strength.
_LIGHTS = (
    ((-0.6, 0.9, 1.2), 0.62), ((1.2, -0.1, 0.9), 0.4), ((-0.2, -1.0, 0.7), 0.25), ((0.2, 0.6, -1.0), 0.25),
)  # fmt: skip


class _View(NamedTuple):
    image: NDArray[np.uint8]
    kernel_at: NDArray[np.float64] | None  # (2, 2): pixel box of the kernel, y down
    units_per_pixel: float  # in the plane through the middle of what is shown
    marked: NDArray[np.float64]  # (0 or 1, 2): pixel of the centre, y down


def write_png(path: Path, scene: Scene, *, title: str, caption: str, size: tuple[int, int]) -> None:
    """Draw the scene, with a close-up where the kernel is too small to be seen."""
    Image, ImageDraw = optional("PIL.Image"), optional("PIL.ImageDraw")
    width, height = size
    unit = height / 1000.0
    head, foot = round(120 * unit) if title or caption else 0, round(100 * unit)
    room = (width, height - head - foot)
    view = _draw(scene, room)
    page = Image.new("RGB", size, "white")
    page.paste(_shrunk(view.image, room), (0, head))
    pen = ImageDraw.Draw(page)
    if view.kernel_at is not None:
        low, high = view.kernel_at / _SUPERSAMPLE + np.array([0, head])
        if float((high - low).max()) < 0.07 * height:
            _add_close_up(page, pen, scene, (low, high), unit, height - foot)
    for x, y in view.marked / _SUPERSAMPLE + np.array([0, head]):
        radius, line = 8 * unit, max(2, round(2.5 * unit))
        pen.ellipse([x - radius, y - radius, x + radius, y + radius], fill=CENTER, outline=INK, width=line)
    left, across = round(36 * unit), width - round(72 * unit)
    _write(pen, (left, round(24 * unit)), title, 40 * unit, INK, across)
    _write(pen, (left, round(76 * unit)), caption, 25 * unit, PALE, across)
    box = left, height - foot, left + across, height
    frame, scale = camera_frame(scene.view, scene.up), view.units_per_pixel * _SUPERSAMPLE
    add_furniture(pen, _write, legend_of(scene), frame, scale, box, unit)
    page.save(path, optimize=True)


def _draw(scene: Scene, size: tuple[int, int], *, close_up: bool = False) -> _View:
    pyvista = optional("pyvista")
    with silent_vtk():
        pixels = [round(v * _SUPERSAMPLE) for v in size]
        plotter: Any = pyvista.Plotter(off_screen=True, window_size=pixels, lighting="none")
        try:
            _light(plotter, pyvista)
            plotter.set_background("white")
            if not close_up:
                _add_surface(plotter, pyvista, scene)
            _add_kernel(plotter, pyvista, scene, close_up)
            _add_witness(plotter, pyvista, scene)
            if len(scene.domain_lines) and not close_up:
                lines = segments(pyvista, scene.domain_lines)
                plotter.add_mesh(lines, color=DOMAIN, line_width=1.4, opacity=0.8, lighting=False)
            points = scene.kernel_vertices if close_up else scene.points
            least = 0.1 * scene.diagonal if len(points) == 1 else 0.0
            scale = look_at(plotter, points, scene.view, scene.up, margin=1.5 if close_up else 1.06, least=least)
            # Without these two lines depth peeling drops everything translucent where VTK renders in software.
            plotter.render_window.SetMultiSamples(0)
            plotter.render_window.AlphaBitPlanesOn()
            plotter.enable_depth_peeling(12)
            image = np.asarray(plotter.screenshot(None, return_img=True))[..., :3]
            at = _to_pixels(plotter, scene.kernel_vertices, pixels) if len(scene.kernel_vertices) else None
            marked = _to_pixels(plotter, scene.center, pixels) if len(scene.center) else scene.center[:, :2]
        finally:
            plotter.close()
    return _View(image, None if at is None else np.array([at.min(axis=0), at.max(axis=0)]), scale, marked)


def _light(plotter: Any, pyvista: Any) -> None:
    """Put a key light above the camera's left shoulder, two fills and a rim from behind."""
    for position, strength in _LIGHTS:
        light = pyvista.Light(position=position, focal_point=(0, 0, 0), intensity=strength, light_type="camera light")
        plotter.add_light(light)


def _add_surface(plotter: Any, pyvista: Any, scene: Scene) -> None:
    data = pyvista.PolyData.from_regular_faces(scene.vertices, scene.faces)
    data = data.compute_normals(
        split_vertices=True, feature_angle=SHARP_DEG, consistent_normals=False, auto_orient_normals=False
    )
    opacity = (0.46 if scene.is_open else 0.27) if len(scene.kernel_vertices) else 0.55
    plotter.add_mesh(
        data, color=SURFACE, opacity=opacity, smooth_shading=True,
        ambient=0.3, diffuse=0.75, specular=0.35, specular_power=28,
    )  # fmt: skip
    if len(scene.surface_lines):
        lines = segments(pyvista, scene.surface_lines)
        plotter.add_mesh(lines, color=LINE, line_width=2.2, opacity=0.75, lighting=False)


def _add_kernel(plotter: Any, pyvista: Any, scene: Scene, close_up: bool) -> None:
    points = scene.kernel_vertices
    if len(points) == 0:
        return
    size = float(np.linalg.norm(np.ptp(points, axis=0))) if close_up and len(points) > 1 else scene.diagonal
    material: dict[str, Any] = {
        "color": scene.kernel_color, "ambient": 0.36, "diffuse": 0.78, "specular": 0.3, "specular_power": 20,
    }  # fmt: skip
    if len(scene.kernel_faces):
        data = pyvista.PolyData.from_regular_faces(points, scene.kernel_faces)
        plotter.add_mesh(data, smooth_shading=scene.is_smooth, **material)
    elif len(points) == 2:
        plotter.add_mesh(pyvista.Tube(pointa=points[0], pointb=points[1], radius=0.007 * size, n_sides=24), **material)
    else:
        plotter.add_mesh(pyvista.Sphere(radius=0.015 * size, center=points[0]), **material)
    if 0 < len(scene.kernel_lines) <= 4000 and len(scene.kernel_faces):
        coarse = len(scene.kernel_lines) <= 150
        plotter.add_mesh(
            segments(pyvista, scene.kernel_lines), color=scene.kernel_line_color, line_width=3.0 if coarse else 1.2,
            opacity=0.9 if coarse else 0.35, lighting=False,
        )  # fmt: skip


def _add_witness(plotter: Any, pyvista: Any, scene: Scene) -> None:
    """Show the facets of the proof, a piece of each plane, and where its inner side is."""
    if len(scene.witness_faces) == 0:
        return
    size = scene.diagonal
    red: dict[str, Any] = {"color": WITNESS, "ambient": 0.4, "diffuse": 0.7}
    plotter.add_mesh(pyvista.PolyData.from_regular_faces(scene.vertices, scene.faces[scene.witness_faces]), **red)
    for center, inward in zip(scene.witness_centers, scene.witness_inward, strict=True):
        disc = pyvista.Disc(center=center, inner=0.0, outer=0.06 * size, normal=inward, r_res=1, c_res=48)
        plotter.add_mesh(disc, opacity=0.45, **red)
        arrow = pyvista.Arrow(
            start=center, direction=inward, scale=0.16 * size, tip_length=0.3, tip_radius=0.09, shaft_radius=0.03
        )
        plotter.add_mesh(arrow, **red)


def segments(pyvista: Any, lines: NDArray[np.float64]) -> Any:
    """Make lines for PyVista of (k, 2, 3) ends."""
    n = len(lines)
    cells = np.column_stack([np.full(n, 2), 2 * np.arange(n), 2 * np.arange(n) + 1]).ravel()
    return pyvista.PolyData(np.ascontiguousarray(lines.reshape(-1, 3)), lines=cells)


def _to_pixels(plotter: Any, points: NDArray[np.float64], pixels: list[int]) -> NDArray[np.float64]:
    matrix = plotter.camera.GetCompositeProjectionTransformMatrix(pixels[0] / pixels[1], -1.0, 1.0)
    full = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
    flat = np.column_stack([points, np.ones(len(points))]) @ full.T
    x, y = (flat[:, :2] / flat[:, 3:]).T
    return np.column_stack([(x + 1.0) * pixels[0] / 2.0, (1.0 - y) * pixels[1] / 2.0])


def _add_close_up(page: Any, pen: Any, scene: Scene, box: tuple[Any, Any], unit: float, bottom: int) -> None:
    """Put a close-up of the kernel in the lower right corner, with a leader to where it is."""
    side, gap = round(300 * unit), round(30 * unit)
    left, top = page.width - side - gap, bottom - side
    inset = _shrunk(_draw(scene, (side, side), close_up=True).image, (side, side))
    middle = (box[0] + box[1]) / 2.0
    radius = max(14.0 * unit, float((box[1] - box[0]).max()) * 0.75)
    line = max(2, round(2.5 * unit))
    target = np.array([left + side / 2.0, top + side / 2.0])
    towards = (target - middle) / np.linalg.norm(target - middle)
    pen.line([tuple(middle + radius * towards), tuple(target)], fill=PALE, width=line)
    pen.ellipse([*(middle - radius), *(middle + radius)], outline=PALE, width=line)
    page.paste(inset, (left, top))
    pen.rectangle([left, top, left + side, top + side], outline=PALE, width=line)
    _write(pen, (left + gap // 2, top + gap // 3), "the kernel, enlarged", 21 * unit, PALE, side)


def _shrunk(image: NDArray[np.uint8], size: tuple[int, int]) -> Any:
    Image = optional("PIL.Image")
    return Image.fromarray(image).resize(size, Image.Resampling.LANCZOS)


def _write(pen: Any, at: tuple[int, int], text: str, size: float, color: str, room: int) -> None:
    """Write one line, cut with an ellipsis where it does not fit."""
    font = _font(size)
    text = " ".join(text.encode("utf-8", "replace").decode().split())
    if pen.textlength(text, font=font) > room:
        while text and pen.textlength(text + "...", font=font) > room:
            text = text[:-1]
        text += "..."
    pen.text(at, text, font=font, fill=color)


def broken(pen: Any, text: str, size: float, room: int) -> list[str]:
    """Break a text between words into lines that fit; one line where there are no words."""
    font = _font(size)
    lines = [""]
    for word in text.encode("utf-8", "replace").decode().split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and pen.textlength(longer, font=font) > room:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines


def _font(size: float) -> Any:
    """DejaVu from Matplotlib, which PyVista brings, knows far more letters than Pillow's own font."""
    fonts = optional("PIL.ImageFont")
    found = find_spec("matplotlib")
    if found is not None and found.origin is not None:
        file = Path(found.origin).parent / "mpl-data" / "fonts" / "ttf" / "DejaVuSans.ttf"
        if file.is_file():
            return fonts.truetype(str(file), round(size))
    return fonts.load_default(round(size))
