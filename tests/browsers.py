"""A page in Chromium that notes what goes wrong in it, for the tests of pages; they are skipped without it."""

import os
import shutil
from contextlib import contextmanager

import pytest

CHROMIUM = os.environ.get("VOXKERNEL_CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")


@contextmanager
def launched():
    """Chromium, without a graphics card."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if CHROMIUM is None:
        pytest.skip("chromium is not installed (apt-get install chromium)")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox", "--enable-unsafe-swiftshader"]
        )
        yield browser
        browser.close()


@contextmanager
def watched_page(width, height, is_own):
    """A page whose `complaints` are errors in its console and requests to addresses that are not its own."""
    with launched() as browser:
        page = browser.new_page(viewport={"width": width, "height": height})
        page.complaints = []
        page.set_default_timeout(120_000)
        page.on("console", lambda m: page.complaints.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: page.complaints.append(str(error)))
        page.on("request", lambda r: None if is_own(r.url) else page.complaints.append(r.url))
        yield page
