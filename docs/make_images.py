"""Make the pictures of ``docs/images`` again: ``python docs/make_images.py [NAME ...]``.

Gallery scripts draw them; they are scaled down to 1100 pixels and 200 colours. Those of real meshes are made where
``VOXKERNEL_DATA`` names them.
"""

from __future__ import annotations

import os
import runpy
import shutil
import subprocess
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
    "report_page": "report",
    "relaxed": "gallery/plot_relaxed.py",
    "three_centres_2": "gallery_data/plot_real_three_centres.py",
    "three_centres_3": "gallery_data/plot_real_three_centres.py",
    "time_against_depth": "gallery/plot_benchmarks.py",
    "time_against_facets": "gallery/plot_benchmarks.py",
    "vdb_volume": "gallery/plot_vdb_volume.py",
    "viewer": "viewer",
}


def report_page() -> None:
    """Take a picture of a report on shapes by formula, in two columns: its beginning, and from the shapes on."""
    from playwright.sync_api import sync_playwright

    def run(*words: str) -> None:
        subprocess.run([sys.executable, *words], check=False, env={**os.environ, "PYTHONPATH": str(HERE.parent)})

    voxkernel = ("-m", "voxkernel.cli.main")
    run(str(HERE.parent / "datasets_tools" / "make_shapes.py"), "shapes", "--count", "4", "--broken", "2")
    asked = ("--labels", "folders", "--profile", "--visible", "--views", "all")
    run(*voxkernel, "evaluate", "shapes", "-o", "run", *asked)
    run(*voxkernel, "report", "run", "-o", "report.html", "--title", "Shapes by formula", "--views", "18")
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 1000})
        page.goto(Path("report.html").absolute().as_uri())
        page.wait_for_selector("html[data-ready=yes]")
        place = page.evaluate("[...document.querySelectorAll('h2')].map((h) => [h.textContent, h.offsetTop])")
        turn = next(top for words, top in place if words == "Shapes to turn") - 30
        page.screenshot(path="whole.png", full_page=True)
        browser.close()
    with Image.open("whole.png") as whole:
        height = min(turn, max(whole.height - turn, 1000))
        both = Image.new("RGB", (2 * whole.width, height), "#fbfcfd")
        for k, top in enumerate((0, turn)):
            part = whole.crop((0, top, whole.width, min(top + height, whole.height)))
            both.paste(part, (k * whole.width, 0))
        both.save("report_page.png")


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
        page = browser.new_page(viewport={"width": 1100, "height": 800})
        page.goto(viewer.url)
        page.wait_for_selector("html[data-ready=yes]")
        page.locator("#vk-stop").fill("3")
        page.wait_for_function("document.body.innerText.includes('relaxed, up to')")
        page.wait_for_timeout(3000)  # until it is drawn
        page.screenshot(path="viewer.png")
        browser.close()


PAGES = {"report": report_page, "viewer": photograph}


def draw(script: str) -> None:
    """Run a gallery script in the current folder, take a picture of a page, or draw that of the README."""
    if script in PAGES:
        PAGES[script]()
        return
    if script:
        runpy.run_path(str(HERE / script), run_name="drawn")
        return
    import voxkernel
    from voxkernel.demo_shapes import urchin
    from voxkernel.pictures import surface_picture

    mesh = urchin()
    surface_picture("urchin_kernel.png", mesh, voxkernel.exact_kernel(mesh), title="", size=(1400, 900))


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
                wide = 1600 if script == "report" else WIDTH
                small.thumbnail((wide, 2 * wide), Image.Resampling.LANCZOS)
                if script != "viewer":  # there, few pixels tell what its colours mean
                    # Colours of few pixels, such as that of a dot, are kept.
                    small = small.quantize(COLORS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
                small.save(HERE / "images" / f"{name}.png", optimize=True)
                print(f"images/{name}.png")
            os.chdir(HERE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
