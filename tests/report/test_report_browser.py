"""The page in a real browser: Debian's chromium, driven by Playwright; skipped where it is not installed."""


import label_shapes
import numpy as np
import pytest
from browsers import launched
from report_runs import HOSTILE, add_view, cell_row, failed_row, large_run, load_rows, surface_row, write_run

from voxkernel.evaluation import EvaluateSettings, evaluate
from voxkernel.report import write_report
from voxkernel.report.text import readable

N = 10_000
SHOWN = "[...document.querySelectorAll('#body tr:not(.pad)')]"
MOST_ROWS = 60  # rows of the table that are elements at any time


@pytest.fixture(scope="module")
def browser():
    with launched() as chromium:
        yield chromium


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report of 10,000 rows, and its rows."""
    folder = tmp_path_factory.mktemp("report")
    large_run(folder / "run", N, np.random.default_rng(20261122))
    write_report(folder / "report.html", folder / "run")
    return folder / "report.html", load_rows(str(folder / "run"))


@pytest.fixture
def opened(browser):
    """Open a file; whatever it says on the console or asks of the network is kept, and must be nothing at the end."""
    contexts, complaints = [], []

    def open_page(path, **options):
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 900}, "offline": True, **options})
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda e: complaints.append(str(e)))
        page.on("dialog", lambda d: complaints.append(f"dialog {d.message}"))
        address = path.as_uri()
        own = (address, "data:", "blob:")
        page.on("request", lambda r: None if r.url.startswith(own) else complaints.append(f"request {r.url}"))
        page.goto(address)
        page.wait_for_selector("html[data-ready=yes]")
        return page

    yield open_page
    for context in contexts:
        context.close()
    assert complaints == []


def table_rows(page):
    return page.locator("#body tr:not(.pad)")


def wait_until(page, expression):
    """Playwright's own waiting evaluates text inside the page, which the page's policy forbids."""
    for _ in range(200):
        if page.evaluate(expression):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"still not so: {expression}")


def settled(page):
    """Pixels of the 3D view, once it is drawn: without a graphics card the first picture takes a while."""
    from io import BytesIO

    from PIL import Image

    before = None
    for _ in range(60):
        page.wait_for_timeout(120)
        picture = Image.open(BytesIO(page.locator("#canvas").screenshot())).convert("RGB")
        image = np.asarray(picture).astype(int)
        if before is not None and np.array_equal(image, before) and tuple(image[12, 12]) != (255, 255, 255):
            return image
        before = image
    raise AssertionError("the view does not come to rest")


def column(page, title):
    """Text of a column, in the order shown."""
    heads = [h.strip() for h in page.locator("#head th").all_inner_texts()]
    at = heads.index(title) + 1
    return [t.strip() for t in page.locator(f"#body tr:not(.pad) td:nth-child({at})").all_inner_texts()]


def head(page, key):
    return page.locator(f'#head th[data-key="{key}"]')


def test_only_the_rows_in_sight_are_elements(opened, report):
    page = opened(report[0])
    assert page.locator("#count").inner_text() == "10,000 of 10,000 rows"
    height = page.evaluate("document.getElementById('frame').scrollHeight")
    for share in (0.0, 0.13, 0.5, 0.77, 1.0):
        page.evaluate(f"document.getElementById('frame').scrollTop = {share} * {height}")
        at = "document.getElementById('frame').scrollTop / 53"
        wait_until(page, f"{SHOWN}.some((r) => Math.abs(r.ariaRowIndex - {at}) < 20)")
        assert 5 < table_rows(page).count() <= MOST_ROWS
    assert page.evaluate("document.querySelectorAll('*').length") < 4000
    assert table_rows(page).last.get_attribute("aria-rowindex") == str(N + 1)
    # Rows are as high as the script believes: the end of the table is the end of the frame.
    assert abs(page.evaluate("document.getElementById('frame').scrollHeight") - height) <= 2
    assert table_rows(page).first.evaluate("r => r.getBoundingClientRect().height") == 53


def test_sorting_by_click_and_by_key(opened, report):
    page, rows = opened(report[0]), report[1]
    head(page, "ratio").get_by_role("button").click()
    assert head(page, "ratio").get_attribute("aria-sort") == "descending"
    best = np.sort(rows.numbers["ratio"][np.isfinite(rows.numbers["ratio"])])[::-1]
    shown = [float(t) for t in column(page, "Ratio")]
    assert shown == pytest.approx(best[: len(shown)], rel=1e-3)
    head(page, "ratio").get_by_role("button").press("Enter")
    assert head(page, "ratio").get_attribute("aria-sort") == "ascending"
    assert float(column(page, "Ratio")[0]) == best[-1]
    head(page, "violation_upper").get_by_role("button").press("Space")
    assert head(page, "ratio").get_attribute("aria-sort") == "none"
    worst = np.sort(np.nan_to_num(rows.numbers["violation_upper"]))[::-1]
    shown = [float(t) for t in column(page, "Defect")]
    assert shown == pytest.approx(worst[: len(shown)], rel=1e-3)
    # Rows without a number are last, whichever the direction.
    for _ in range(2):
        page.evaluate("document.getElementById('frame').scrollTop = 1e9")
        wait_until(page, f"{SHOWN}.at(-1).ariaRowIndex == {N + 1}")
        assert column(page, "Defect")[-1] == "–"
        head(page, "violation_upper").get_by_role("button").click()
    head(page, "file").get_by_role("button").click()
    assert head(page, "file").get_attribute("aria-sort") == "ascending"


def test_filters(opened, report):
    page, rows = opened(report[0]), report[1]
    page.locator("#outcome").select_option("failed")
    assert page.locator("#count").inner_text() == "100 of 10,000 rows"
    assert set(column(page, "Verdict")) == {"failed: file is not a mesh: 12 bytes"}
    page.locator("#outcome").select_option("")
    page.locator("#label").select_option("convex")
    n = rows.texts["label"].count("convex")
    assert page.locator("#count").inner_text() == f"{n:,} of 10,000 rows"
    page.get_by_label("Search").fill("0040 CONVEX")
    matches = sum("0040" in f for f, s in zip(rows.texts["file"], rows.texts["label"], strict=True) if s == "convex")
    assert page.locator("#count").inner_text() == f"{matches} of 10,000 rows"
    assert table_rows(page).count() == matches
    page.get_by_label("Search").fill("no such row")
    assert table_rows(page).count() == 0
    page.get_by_role("button", name="Clear").click()
    assert page.locator("#count").inner_text() == "10,000 of 10,000 rows"
    page.locator(".tile", has_text="degenerate").click()
    expected = rows.outcome.count("degenerate")
    assert page.locator("#count").inner_text() == f"{expected} of 10,000 rows"


def test_a_view_opens_turns_and_closes(opened, report):
    page = opened(report[0])
    card = page.locator("[data-open]").first
    card.focus()
    card.press("Enter")
    dialog = page.locator("dialog#shape")
    assert dialog.is_visible()
    canvas = page.locator("#canvas")
    assert page.evaluate("document.activeElement.id") == "canvas"

    def picture():
        return settled(page)[10:-10, 10:-10].tobytes()  # without the ring of the focus

    before = picture()
    assert len(set(before)) > 10
    canvas.press("ArrowLeft")
    turned = picture()
    assert turned != before
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 320, box["y"] + 240, steps=4)
    page.mouse.up()
    dragged = picture()
    assert dragged != turned
    page.get_by_role("button", name="Close-up of the kernel").click()
    assert picture() != dragged
    page.get_by_role("button", name="Reset").press("Enter")
    assert picture() == before
    page.get_by_role("button", name="Next").click()
    assert dialog.is_visible()
    page.keyboard.press("Escape")
    assert not dialog.is_visible()


def test_the_kernel_is_drawn_inside_the_surface(opened, report):
    page = opened(report[0])
    page.locator("[data-open]").first.click()
    image = settled(page)
    red, green, blue = image[..., 0], image[..., 1], image[..., 2]
    kernel = (red - blue > 60) & (red - green > 25)
    surface = np.abs(image - image[12, 12]).sum(axis=-1) > 30
    assert 200 < kernel.sum() < 0.2 * surface.sum()
    y, x = np.nonzero(surface)
    inner_y, inner_x = np.nonzero(kernel)
    assert x.min() < inner_x.min() <= inner_x.max() < x.max()
    assert y.min() < inner_y.min() <= inner_y.max() < y.max()


def test_hostile_names_are_text(opened, report):
    page = opened(report[0])
    title = page.title()
    for name in HOSTILE:
        page.get_by_label("Search").fill(readable(name).strip()[:80])
        assert readable(name).strip() in [" ".join(t.split(" ")) for t in column(page, "File")]
        table_rows(page).first.get_by_role("button").click()
        assert readable(name) == page.locator("#facts dd").first.text_content()
        page.keyboard.press("Escape")
    assert page.title() == title
    assert page.locator("svg [onload], img[src=x]").count() == 0


def test_the_saved_rows_are_the_shown_ones(opened, report, tmp_path):
    page = opened(report[0], accept_downloads=True)
    page.get_by_label("Search").fill("example.com")
    shown = page.locator("#count").inner_text()
    with page.expect_download() as download:
        page.get_by_role("button", name="Save these rows as CSV").click()
    download.value.save_as(tmp_path / "rows.csv")
    import csv

    with open(tmp_path / "rows.csv", newline="", encoding="utf-8") as stream:
        lines = list(csv.DictReader(stream))
    assert shown == f"{len(lines)} of 10,000 rows"
    names = [line["file"] for line in lines]
    assert any(name.startswith("'=HYPERLINK") for name in names)
    assert not any(name[0] in "=+-@" for name in names)
    assert "ratio" in lines[0]


@pytest.mark.parametrize(
    "options", [{"color_scheme": "dark"}, {"viewport": {"width": 360, "height": 700}}, {"reduced_motion": "reduce"}]
)
def test_dark_and_narrow(opened, report, options):
    page = opened(report[0], **options)
    width = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
    assert width[0] <= width[1]
    page.locator("[data-open]").last.click()
    assert page.locator("#canvas").is_visible()
    close = page.get_by_role("button", name="Close", exact=True)
    assert close.bounding_box()["x"] + close.bounding_box()["width"] <= width[1]
    background, ink = page.evaluate("(s => [s.backgroundColor, s.color])(getComputedStyle(document.body))")
    dark = options.get("color_scheme") == "dark"
    assert (_light(background) < _light(ink)) == dark


def test_without_scripts_the_numbers_are_there(opened, report, browser):
    context = browser.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(report[0].as_uri())
    assert "100 of 10,000 rows failed" in page.locator("body").inner_text()
    assert page.locator("figure svg").count() >= 3
    assert "The table needs JavaScript" in page.locator("body").inner_text()
    context.close()


def test_cells_have_their_own_columns(opened, rng, tmp_path):
    write_run(tmp_path / "run", [cell_row("cells.vtu", k, rng) for k in range(30)])
    write_report(tmp_path / "r.html", tmp_path / "run")
    page = opened(tmp_path / "r.html")
    head(page, "volume_share").get_by_role("button").click()
    shares = [float(t) for t in column(page, "Volume share")]
    assert shares == sorted(shares, reverse=True)
    assert column(page, "File")[0].startswith("cells.vtu cell ")


def test_printing_shows_rows(opened, report):
    page = opened(report[0])
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert table_rows(page).count() == 200
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert table_rows(page).count() <= MOST_ROWS


def _light(css):
    return sum(float(v) for v in css[css.index("(") + 1 : -1].split(",")[:3])


def test_objects_of_label_images_are_found_by_number_and_reason(opened, tmp_path):
    image = np.zeros((9, 9, 27), np.uint8)
    image[:, :, :9] = label_shapes.ball(9)
    image[:4, :, 9:18] = 2 * label_shapes.c_shape(9, 2).repeat(2, 0)
    image[1:4, 1:4, 18:21] = image[5:8, 5:8, 23:26] = 3
    np.savez(tmp_path / "three.npz", labels=image, spacing=np.ones(3))
    settings = EvaluateSettings(label_images=True, thumbnails=False, workers=1)
    evaluate([tmp_path / "three.npz"], output=tmp_path / "run", settings=settings)
    write_report(tmp_path / "report.html", tmp_path / "run")
    page = opened(tmp_path / "report.html")
    found = {}
    for words in ("object 2", "hidden part", "fragment", "three", "elongated"):
        page.fill("#search", words)
        found[words] = page.evaluate(f"{SHOWN}.map((row) => row.dataset.row)")
    assert found == {
        "object 2": ["1"], "hidden part": ["1"], "fragment": ["2"], "three": ["0", "1", "2"],
        "elongated": ["1"],  # its other cause
    }  # fmt: skip
    page.fill("#search", "object 3")
    page.click("#body button")
    assert page.inner_text("#shape-name").endswith("three.npz object 3")
    overlaps = page.evaluate("[...document.querySelectorAll('#facts dd')].map((dd) => dd.textContent)")
    assert not any(len(item) > 9 for text in overlaps for item in text.split(", ") if item.startswith("0."))


def label_row(number, seen, overlap, needed, **more):
    return {
        "file": "cells.tif", "kind": "label", "object": number, "status": "ok", "voxels": 1000, "voxels_seen": seen,
        "voxels_seen_upper": seen, "verdict": "star-shaped" if seen == 1 else "not star-shaped", "n_rays": [32, 96],
        "iou": [overlap / 2, overlap], "iou_stepped": [overlap / 2, overlap], "overlap": overlap, "rays_for_80": needed,
        "rays_for_90": 0, "seen_deepest": seen, "seen_centroid": seen, **more,
    }  # fmt: skip


@pytest.fixture(scope="module")
def objects(tmp_path_factory):
    """Objects 2, 21, 300 and 301 of one image."""
    folder = tmp_path_factory.mktemp("objects")
    few = {"shortfall": "elongated", "shortfall_detail": "too elongated for 96 rays", "causes": ["elongated"]}
    part = {"shortfall": "hidden part", "shortfall_detail": "hidden part of less than 0.01%; 2 fragments",
            "causes": ["hidden part", "fragment"]}  # fmt: skip
    rows = [
        label_row(2, 1.0, 0.85, 96), label_row(21, 1.0, 0.4, 0, **few), label_row(300, 0.99999999, 0.9, 32, **part),
        label_row(301, 0.5, 0.45, 0, **part),
    ]  # fmt: skip
    write_run(folder / "run", rows)
    write_report(folder / "report.html", folder / "run")
    return folder / "report.html"


def numbers_found(page, words):
    page.fill("#search", words)
    return [int(name.split()[-1]) for name in column(page, "File")]


def test_objects_are_filtered_by_overlap_and_rays(opened, objects):
    page = opened(objects)
    assert page.get_by_label("Search, or compare: iou<0.8 seen<0.9").count() == 1
    for words, found in (
        ("iou<0.8", [21, 301]), ("overlap>=0.85", [2, 300]), ("rays_for_80<=96", [2, 300]),
        ("rays_for_80>96", [21, 301]), ("seen<1", [300, 301]), ("fragment", [300, 301]),
    ):  # fmt: skip
        assert numbers_found(page, words) == found
        assert "no column" not in page.inner_text("#count")


def test_no_number_of_rays_is_never_and_more_than_any(opened, objects):
    page = opened(objects)
    assert column(page, "Rays for 0.8") == ["96", "never", "32", "never"]
    head(page, "rays_for_80").get_by_role("button").click()
    assert column(page, "Rays for 0.8") == ["never", "never", "96", "32"]
    page.locator("#body button").first.click()
    assert "Rays for 0.9never" in page.locator("#facts").text_content()


def test_the_beginning_of_a_number_finds_objects_until_one_has_it(opened, objects):
    page = opened(objects)
    assert numbers_found(page, "object 2") == [2]
    assert numbers_found(page, "object 30") == [300, 301]
    assert numbers_found(page, "object 300") == [300]
    assert numbers_found(page, "object 7") == []


def test_nearly_all_is_not_all(opened, objects):
    page = opened(objects)
    assert column(page, "Seen") == ["1", "1", "< 1", "0.5"]
    causes = page.locator("#objects table tbody tr").all_inner_texts()
    assert [line.split("\t") for line in causes] == [
        ["hidden part", "2", "50 %", "2"], ["elongated", "1", "25 %", "1"], ["fragment", "0", "0 %", "2"],
        ["none", "1", "25 %", ""],
    ]  # fmt: skip


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    """Twelve surfaces, two of them with a view, and fifty cells of two volume meshes."""
    folder, rng = tmp_path_factory.mktemp("mixed"), np.random.default_rng(20261127)
    rows = [surface_row(f"{k}.ply", rng, kind="not star-shaped" if k % 2 else "star-shaped") for k in range(12)]
    rows[3] |= {"violation_upper": 0.000123456789, "visible_fraction": 0.99987654321}
    for row in rows[:2]:
        add_view(folder / "run", row)
    rows += [cell_row(f"m{k % 2}.vtu", k, rng) for k in range(50)]
    write_run(folder / "run", rows)
    write_report(folder / "report.html", folder / "run")
    return folder / "report.html", load_rows(str(folder / "run"))


def test_numbers_are_compared_by_column(opened, mixed):
    path, rows = mixed
    page = opened(path)
    surfaces = rows.only("surface")
    assert page.locator("#count").inner_text() == "12 of 62 rows"
    for words, n in (
        ("ratio<0.2", int((surfaces.numbers["ratio"] < 0.2).sum())),
        ("defect > 0.02", int((surfaces.numbers["violation_upper"] > 0.02).sum())),
        ("ratio<=0 .ply", int((surfaces.numbers["ratio"] <= 0).sum())),
        ("facets=5000 ratio>0", int((surfaces.numbers["ratio"] > 0).sum())),
    ):
        page.fill("#search", words)
        assert page.locator("#count").inner_text() == f"{n} of 62 rows"
    page.fill("#search", "colour<3")
    assert page.locator("#count").inner_text() == "12 of 62 rows; no column of numbers is called colour"


def test_numbers_are_never_cut(opened, mixed):
    page = opened(mixed[0])
    page.evaluate("document.getElementById('kind').value = ''")
    page.locator("#kind").dispatch_event("change")
    cut = "[...document.querySelectorAll('#body td.n div')].filter((d) => d.scrollWidth > d.clientWidth).length"
    assert page.evaluate(cut) == 0


def test_cells_are_behind_their_volume_mesh(opened, mixed):
    page = opened(mixed[0])
    rows = page.locator("#cells tbody tr")
    assert rows.count() - 2 == page.locator("#cells .ranks tbody tr").count()
    page.locator('[data-cells="m1.vtu"]').click()
    assert page.locator("#count").inner_text() == "25 of 62 rows"
    assert {name.split(" cell")[0] for name in column(page, "File")} == {"m1.vtu"}
    page.locator("#clear").click()
    assert page.locator("#count").inner_text() == "62 of 62 rows"


def test_a_relaxed_kernel_has_another_colour(opened, mixed):
    page = opened(mixed[0])
    found = {}
    for name, hidden in (("0.ply", True), ("1.ply", False)):
        page.locator(f'[aria-label="3D view of {name}"]').first.click()
        assert page.locator("#relaxed").is_hidden() == hidden
        page.locator("#opacity").fill("0")  # what is seen through the surface has its colour, too
        image = settled(page)
        saturated = image[np.ptp(image, axis=2) > 70]
        found[name] = np.median(saturated, axis=0)
        page.locator("#close").click()
    orange, purple = found["0.ply"], found["1.ply"]
    assert orange[0] > orange[1] > orange[2]
    assert purple[2] > purple[1]


def test_it_prints_as_one_sheet(opened, rng, tmp_path):
    """Long names, many labels, reasons, classes and another run: one page of A4, and nothing on it is cut off."""
    rows = [
        surface_row(HOSTILE[k] if k < len(HOSTILE) else f"folder/{60 * 'x'}{k}.ply", rng, f"label {30 * 'w'} {k % 30}",
                    ("star-shaped", "not star-shaped", "degenerate")[k % 3])
        for k in range(90)
    ]  # fmt: skip
    rows += [failed_row(f"{k}.ply", f"reason {k} {60 * 'long '}") for k in range(40)]
    rows += [cell_row("cells.vtu", k, rng) for k in range(20)]
    now, before = write_run(tmp_path / "now", rows), write_run(tmp_path / "before", rows[40:])
    classes = [f"a class with a {5 * 'long '}name: defect<0.01; b: defect<0.1; c: ratio>0.1; d: ratio>0"]
    write_report(tmp_path / "r.html", now, compare=before, classes=classes)
    page = opened(tmp_path / "r.html", viewport={"width": 703, "height": 1032})
    assert page.locator(".sheet").is_hidden()
    page.emulate_media(media="print")
    assert page.locator("#all").is_hidden()
    room = page.evaluate("(({ scrollHeight, clientHeight }) => [scrollHeight, clientHeight])("
                         "document.querySelector('.sheet'))")  # fmt: skip
    assert room[0] <= room[1]
    pdf = page.pdf(prefer_css_page_size=True)
    assert pdf.count(b"/Type /Page\n") == 1
    page.emulate_media(media="screen")
    page.locator("#print-all").check()
    page.emulate_media(media="print")
    assert page.locator("#all").is_visible()
    assert page.locator(".sheet").is_hidden()


def test_columns_are_those_of_the_kind(opened, rng, tmp_path):
    rows = [surface_row(f"{k}.ply", rng) for k in range(3)] + [cell_row("c.vtu", k, rng) for k in range(3)]
    write_run(tmp_path / "run", rows)
    write_report(tmp_path / "r.html", tmp_path / "run")
    page = opened(tmp_path / "r.html")
    heads = "[...document.querySelectorAll('#head th')].map((h) => h.textContent.trim())"
    assert "Volume share" not in page.evaluate(heads)
    page.locator("#kind").select_option("cell")
    assert "Volume share" in page.evaluate(heads)
    assert table_rows(page).count() == 3
    cut = "[...document.querySelectorAll('#body td.n div')].filter((d) => d.scrollWidth > d.clientWidth).length"
    assert page.evaluate(cut) == 0  # numbers are never cut
    page.locator("#kind").select_option("")
    assert {"Volume share", "Visible"} <= set(page.evaluate(heads))
