"""Make the pictures of ``docs/images`` again: ``python docs/make_images.py [NAME ...]``.

Gallery scripts draw them; they are scaled down to 1100 pixels and 200 colours. Those of real meshes are made where
``VOXKERNEL_DATA`` names them.
"""

from __future__ import annotations

import os
import runpy
import shutil
import sys
import tempfile
from pathlib import Path

from PIL import Image

HERE = Path(__file__).resolve().parent
WIDTH, COLORS = 1100, 200
SCRIPTS = {
    "urchin_kernel": "",
    "domain_hull": "gallery/plot_domains.py",
    "domain_ball": "gallery/plot_domains.py",
    "failed_star": "gallery/plot_failed_star.py",
    "registration": "gallery/plot_registration.py",
    "relaxed": "gallery/plot_relaxed.py",
    "three_centres_2": "gallery_data/plot_real_three_centres.py",
    "three_centres_3": "gallery_data/plot_real_three_centres.py",
    "time_against_depth": "gallery/plot_benchmarks.py",
    "time_against_facets": "gallery/plot_benchmarks.py",
    "vdb_volume": "gallery/plot_vdb_volume.py",
    "viewer": "viewer",
}


def draw(script: str) -> None:
    """Run a gallery script in the current folder, or draw the picture of the README."""
    if script == "viewer":
        photograph()
        return
    if script:
        runpy.run_path(str(HERE / script), run_name="drawn")
        return
    import voxkernel
    from voxkernel.demo_shapes import urchin
    from voxkernel.pictures import surface_picture

    mesh = urchin()
    surface_picture("urchin_kernel.png", mesh, voxkernel.exact_kernel(mesh), title="", size=(1400, 900))


def photograph() -> None:
    """Take a picture of the viewer in Chromium, with the probe moved and a relaxed kernel."""
    from playwright.sync_api import sync_playwright

    import voxkernel
    from voxkernel.demo_shapes import torus

    mesh = voxkernel.as_mesh(torus())
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    with mesh.plot(title="torus", depth=7, browser=False) as viewer, sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=chromium, args=["--no-sandbox", "--enable-unsafe-swiftshader"]
        )
        page = browser.new_page(viewport={"width": 1100, "height": 740})
        page.goto(viewer.url)
        page.wait_for_selector("html[data-ready=yes]")
        page.locator("#vk-stop").fill("3")
        page.wait_for_timeout(3000)
        page.screenshot(path="viewer.png")
        browser.close()


def main(names: list[str]) -> int:
    """Make all pictures, or those named."""
    wanted = names or list(SCRIPTS)
    for script in dict.fromkeys(SCRIPTS[name] for name in wanted):
        if script.startswith("gallery_data") and "VOXKERNEL_DATA" not in os.environ:
            print(f"{script}: VOXKERNEL_DATA is not set, left out")
            continue
        with tempfile.TemporaryDirectory() as folder:
            work = Path(folder) / "images"
            work.mkdir()
            (Path(folder) / "benchmarks").symlink_to(HERE / "benchmarks")
            os.chdir(work)
            draw(script)
            for name in wanted:
                if SCRIPTS[name] != script:
                    continue
                with Image.open(work / f"{name}.png") as picture:
                    small = picture.convert("RGB")
                small.thumbnail((WIDTH, WIDTH), Image.Resampling.LANCZOS)
                if name == "viewer":  # few pixels tell what its colours mean
                    small.save(HERE / "images" / f"{name}.png", optimize=True)
                    continue
                small.quantize(COLORS, dither=Image.Dither.NONE).save(HERE / "images" / f"{name}.png", optimize=True)
                print(f"images/{name}.png")
            os.chdir(HERE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
