"""The viewer as a user has it: the command, a real browser (skipped without one), and Ctrl-C at the end."""

import os
import re
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import shapes
from browsers import watched_page

import voxkernel

STOPS = [0.05, 0.12]
SHELL = {**os.environ, "PYTHONPATH": str(Path(voxkernel.__file__).parents[1])}


def bumpy():
    """Star-shaped, with a kernel that is much smaller than the surface."""
    vertices, faces = shapes.icosphere(2)
    vertices = np.array(vertices)
    radius = 1.0 + 0.35 * np.sin(5 * vertices[:, 0]) * np.sin(4 * vertices[:, 1]) * np.cos(3 * vertices[:, 2])
    return voxkernel.as_mesh((vertices * radius[:, None], faces))


@pytest.fixture(scope="module")
def mesh():
    return bumpy()


@pytest.fixture(scope="module")
def command(mesh, tmp_path_factory):
    """The running command and the address it printed; interrupted at the end, which must be clean."""
    file = tmp_path_factory.mktemp("view") / "bumpy.ply"
    mesh.write(file)
    words = ["view", str(file), "--no-browser", "--depth", "4", "--tolerances", ",".join(map(str, STOPS))]
    process = subprocess.Popen(
        [sys.executable, "-m", "voxkernel.cli.main", *words], env=SHELL, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        url = process.stdout.readline().strip()
        assert url.startswith("http"), process.stderr.read()
        yield process, url
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def page(command):
    url = command[1]
    with watched_page(770, 400, lambda address: address.split("/")[2:3] == url.split("/")[2:3]) as page:
        page.goto(url)
        page.wait_for_selector("html[data-ready=yes]")
        yield page


def text(page, name):
    return page.inner_text(f"#vk-{name}")


def until(page, holds):
    """Wait for what the page does in its own time; what is asked for and found, else how it was at the end."""
    for _ in range(300):
        found = holds()
        if found:
            break
        page.wait_for_timeout(50)
    return found


def changed(page, name, before):
    """The text of a part of the panel once it is another."""
    assert until(page, lambda: text(page, name) != before), f"{name} is still {before!r}"
    return text(page, name)


def picture(page):
    """Pixels of the picture once they no longer change."""
    from PIL import Image

    before = None
    for _ in range(80):
        page.wait_for_timeout(200)
        image = np.asarray(Image.open(BytesIO(page.locator("#vk-picture").screenshot())).convert("RGB")).astype(int)
        if before is not None and np.array_equal(image, before):
            return image
        before = image
    raise AssertionError("the picture does not come to rest")


def pixels(image):
    red, green, blue = image[..., 0], image[..., 1], image[..., 2]
    return {
        "drawn": int((image.min(axis=2) < 235).sum()),
        "orange": int(((red - blue > 50) & (red - green > 25) & (green - blue > 15)).sum()),
        "purple": int(((red - green > 25) & (blue - green > 25)).sum()),
        "red": int(((red - green > 60) & (red - blue > 60) & (abs(green - blue) < 30)).sum()),
    }


def name_of(tolerance):
    return f"relaxed, up to {100 * tolerance:g} % of the area turned away"


def share(words):
    return float(words.split(" %")[0])


def point_of(page):
    return np.array([float(page.input_value(f"#vk-{axis}")) for axis in "xyz"])


def test_it_begins_with_the_exact_kernel_and_its_deepest_point(page, mesh):
    kernel = voxkernel.exact_kernel(mesh)
    assert np.allclose(point_of(page), kernel.deepest_point, atol=1e-4)
    seen = text(page, "seen")
    assert (changed(page, "seen", "…") if seen == "…" else seen) == "100 % of the area"
    assert text(page, "violation") == "0 % of the area (0 triangles)"
    assert float(text(page, "clearance").split()[0]) == pytest.approx(kernel.clearance, rel=1e-3)
    assert text(page, "stop-name") == "exact kernel"
    found = pixels(picture(page))
    assert found["orange"] > 200
    assert found["purple"] == found["red"] == 0


def test_relaxed_kernels_grow_along_the_slider(page, mesh):
    kernels = voxkernel.voxel_kernels(mesh, tolerances=STOPS, depth=4)
    seen = []
    for stop, kernel in enumerate(kernels, 1):
        before = text(page, "stop-name")
        page.locator("#vk-stop").fill(str(stop))
        assert changed(page, "stop-name", before) == name_of(STOPS[stop - 1])
        assert f"volume between {kernel.volume_bounds[0]:.4g}" in text(page, "stop-words")
        seen.append(pixels(picture(page)))
    assert seen[0]["orange"] < 50
    assert 200 < seen[0]["purple"] < seen[1]["purple"]
    page.locator("#vk-stop").fill("0")
    changed(page, "stop-name", before=name_of(STOPS[-1]))


def test_the_probe_is_dragged(page, mesh):
    before, seen = text(page, "violation"), text(page, "seen")
    box = page.locator("#vk-probe").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    for k in range(1, 6):
        page.mouse.move(x + 16 * k, y - 13 * k)
    changed(page, "violation", before)
    page.mouse.up()
    changed(page, "seen", seen)
    image = picture(page)
    moved = page.locator("#vk-probe").bounding_box()
    assert (moved["x"] - box["x"], moved["y"] - box["y"]) == pytest.approx((80, -65), abs=2)
    point = point_of(page)
    assert share(text(page, "violation")) == pytest.approx(100 * voxkernel.violation(mesh, [point])[0], abs=0.2)
    depth = np.einsum("ij,ij->i", mesh.facet_normals, mesh.vertices[mesh.faces[:, 0]] - point).min()
    assert float(text(page, "clearance").split()[0]) == pytest.approx(depth, abs=1e-3)
    assert share(text(page, "seen")) == pytest.approx(100 * voxkernel.visible_fraction(mesh, point).fraction, abs=3)
    assert pixels(image)["red"] > 100


def box_of(page):
    """Left and upper end of the ring round the probe."""
    box = page.locator("#vk-probe").bounding_box()
    return box["x"], box["y"]


@pytest.mark.slow
def test_the_view_turns_and_the_ring_stays_on_the_point(page):
    point, before = point_of(page), box_of(page)
    place = page.locator("#vk-picture").bounding_box()
    page.mouse.move(place["x"] + 60, place["y"] + 60)
    page.mouse.down()
    page.mouse.move(place["x"] + 160, place["y"] + 90, steps=4)
    page.mouse.up()
    assert until(page, lambda: box_of(page) != before)
    assert np.array_equal(point_of(page), point)
    page.locator("#vk-reset").click()
    assert until(page, lambda: box_of(page) == pytest.approx(before, abs=1))


@pytest.mark.slow
def test_keys_and_typed_numbers_move_the_probe_too(page):
    before = text(page, "clearance")
    page.locator("#vk-probe").press("PageDown")
    changed(page, "clearance", before)
    page.locator("#vk-x").fill("7")
    page.locator("#vk-x").press("Enter")
    assert until(page, lambda: share(text(page, "seen")) < 1)
    page.locator("#vk-deepest").click()
    assert until(page, lambda: text(page, "violation") == "0 % of the area (0 triangles)")


@pytest.mark.slow
def test_a_section_cuts_half_away(page):
    whole = pixels(picture(page))["drawn"]
    page.select_option("#vk-axis", "x")
    assert until(page, lambda: pixels(picture(page))["drawn"] < 0.9 * whole)
    page.select_option("#vk-axis", "")
    assert until(page, lambda: pixels(picture(page))["drawn"] == whole)


@pytest.mark.slow
def test_a_reload_shows_the_same(page):
    page.locator("#vk-stop").fill("1")
    before = changed(page, "stop-name", "exact kernel")
    page.reload()
    page.wait_for_selector("html[data-ready=yes]")
    assert text(page, "stop-name") == before
    assert pixels(picture(page))["purple"] > 200


def test_nothing_was_wrong_in_the_browser_and_nothing_left_the_machine(page):
    assert page.complaints == []


def test_only_this_machine_is_answered_and_only_who_knows_the_address(command):
    _, url = command
    found = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]{32})/", url)
    port = int(found[1])
    sockets = Path("/proc/net/tcp")
    if sockets.exists():
        listening = [line.split()[1] for line in sockets.read_text().splitlines()[1:] if line.split()[3] == "0A"]
        assert [place for place in listening if place.endswith(f":{port:04X}")] == [f"0100007F:{port:04X}"]
    told = urllib.request.urlopen(urllib.request.Request(f"{url}paraview/", method="POST"), timeout=10).read()
    assert b"secret" in told
    for wrong in ("paraview/", "x" * 32 + "/paraview/"):
        request = urllib.request.Request(f"http://127.0.0.1:{port}/{wrong}", method="POST")
        with pytest.raises(urllib.error.HTTPError, match=r"40[45]"):
            urllib.request.urlopen(request, timeout=10)


def test_an_interrupt_ends_it(command):
    process, _ = command
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0
    assert out == ""
    assert err.endswith("voxkernel: Ctrl-C ends the viewer\nvoxkernel: the viewer has ended\n")
