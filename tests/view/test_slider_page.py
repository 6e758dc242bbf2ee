"""The page with a slider: no server, no network, the surface once, a kernel for each stop."""

import json
import re
import shutil
import socket
import sys
import warnings

import numpy as np
import pytest
import shapes
from browsers import watched_page

import voxkernel
from voxkernel.cli.main import main
from voxkernel.view import open_viewer, slider_page

TOLERANCES = [0.05, 0.2, 0.4]


@pytest.fixture(scope="module")
def prism():
    return voxkernel.as_mesh(shapes.l_prism())


@pytest.fixture(scope="module")
def written(prism, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "page.html"
    slider_page(path, prism, tolerances=TOLERANCES, depth=4, title="<L>")
    return path


def name_of(tolerance):
    return f"relaxed, up to {100 * tolerance:g} % of the area turned away"


def parts_of(path):
    """Traces and layout of the page's figure."""
    text = path.read_text(encoding="utf-8")
    found = re.search(r'Plotly\.newPlot\(\s*"[^"]*",\s*', text)
    traces, end = json.JSONDecoder().raw_decode(text, found.end())
    layout, _ = json.JSONDecoder().raw_decode(text, end + len(re.match(r",\s*", text[end:])[0]))
    return traces, layout


def test_a_stop_shows_the_surface_and_its_own_kernel(written):
    traces, layout = parts_of(written)
    steps = layout["sliders"][0]["steps"]
    assert [step["label"] for step in steps] == ["exact", "5 %", "20 %", "40 %"]
    names = [trace.get("name") for trace in traces]
    assert names.count("surface") == 1
    for i, step in enumerate(steps):
        shown = {n for n, on in zip(names, step["args"][0]["visible"], strict=True) if on}
        kernel = {name_of(TOLERANCES[i - 1])} if i else {"exact kernel", "deepest point"}
        assert shown - {"surface", "domain: hull", "", None} == kernel
        assert "&lt;L&gt;" in step["args"][1]["title.text"]
    assert [trace.get("visible", True) for trace in traces] == steps[0]["args"][0]["visible"]


def test_what_stands_below_is_there_at_every_stop(written):
    """Axes, a scale bar with its length, the deepest point; all of it inside the space that is shown."""
    traces, layout = parts_of(written)
    words = [(k, trace["text"]) for k, trace in enumerate(traces) if trace.get("mode") == "text"]
    assert [text for _, text in words] == [["x", "y", "z", "0.5 mesh units"]]
    for step in layout["sliders"][0]["steps"]:
        assert step["args"][0]["visible"][words[0][0]]
    marked = [len(step["args"][1]["scene.annotations"]) for step in layout["sliders"][0]["steps"]]
    assert marked == [2, 0, 0, 0]  # a dot with a rim; a relaxed kernel is marked by none
    places = np.array([traces[words[0][0]][axis] for axis in "xyz"])
    low, high = np.array([layout["scene"][f"{axis}axis"]["range"] for axis in "xyz"]).T
    assert ((places.T >= low) & (places.T <= high)).all()


def test_it_needs_no_network(written):
    text = written.read_text(encoding="utf-8")
    assert not re.search(r'<(script|link|img)[^>]+(src|href)="(?!data:)', text)


def test_an_empty_kernel_shows_the_facets_of_its_proof(tmp_path):
    slider_page(tmp_path / "t.html", shapes.torus(n_major=8, n_minor=6), tolerances=[0.9], depth=3)
    traces, _ = parts_of(tmp_path / "t.html")
    assert "facets of the proof" in [trace.get("name") for trace in traces]


@pytest.mark.slow
def test_the_slider_moves_in_a_browser(written):
    with watched_page(700, 500, lambda url: url.startswith(("file:", "data:", "blob:"))) as page:
        page.goto(written.as_uri())
        plot = "document.querySelector('.js-plotly-plot')"
        shown = f"{plot}._fullData.filter((t) => t.visible === true).map((t) => t.name)"
        page.wait_for_function(f"{plot}?._fullData")
        assert "exact kernel" in page.evaluate(shown)
        rail = page.locator(".slider-rail-touch-rect").bounding_box()
        page.mouse.click(rail["x"] + rail["width"] - 2, rail["y"] + rail["height"] / 2)
        page.wait_for_function(f"{shown}.includes('{name_of(0.4)}')")
        assert "exact kernel" not in page.evaluate(shown)
    assert page.complaints == []


def test_what_is_wrong_is_said(prism, tmp_path):
    with pytest.raises(ValueError, match=r"`path` must end in \.html; got 'page\.png'"):
        slider_page(tmp_path / "page.png", prism)
    with pytest.raises(ValueError, match="`tolerances` must be"):
        slider_page(tmp_path / "page.html", prism, tolerances=[2.0])
    with pytest.raises(ValueError, match="`depth` must be"):
        slider_page(tmp_path / "page.html", prism, depth=2)
    with pytest.raises(ValueError, match="`port` must be"):
        open_viewer(prism, port=70000)


@pytest.fixture
def no_trame(monkeypatch):
    import voxkernel._extras as extras

    found = extras.find_spec
    monkeypatch.setattr(extras, "find_spec", lambda name: None if name == "trame" else found(name))


def test_without_the_extra_one_line_says_so_and_a_page_is_written(no_trame, prism, tmp_path, monkeypatch, capsys):
    prism.write(tmp_path / "prism.ply")
    monkeypatch.chdir(tmp_path)
    assert main(["view", "prism.ply", "--no-browser", "--tolerances", "0.1", "--depth", "3"]) == 0
    said = capsys.readouterr()
    assert said.out == ""
    assert re.fullmatch(
        r"voxkernel: `trame` is not installed; the extra `view` brings it: .*; "
        r"instead of the viewer a page with the same slider is written to prism_view\.html\n", said.err,
    )  # fmt: skip
    assert len(parts_of(tmp_path / "prism_view.html")[1]["sliders"][0]["steps"]) == 2


def test_without_either_extra_the_first_is_named(no_trame, prism, monkeypatch, capsys):
    import voxkernel._extras as extras

    found = extras.find_spec
    monkeypatch.setattr(extras, "find_spec", lambda name: None if name == "plotly" else found(name))
    assert main(["view", "never-read.ply"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("voxkernel: error: `trame` is not installed; the extra `view` brings it: ")
    assert said.count("\n") == 1
    with pytest.raises(voxkernel.MissingExtraError, match="`trame` is not installed"):
        prism.plot()


def test_without_the_extra_plot_gives_the_page(no_trame, prism):
    with pytest.warns(UserWarning, match="the extra `view` brings it"):
        viewer = prism.plot(tolerances=[0.1], depth=3, browser=False)
    with viewer:
        assert not viewer.is_open
        assert viewer.url.startswith("file://")
        assert viewer.url in viewer._repr_html_()
        viewer.wait()


def test_the_command_writes_the_page_on_request(prism, tmp_path, capsys):
    prism.write(tmp_path / "prism.ply")
    words = ["view", str(tmp_path / "prism.ply"), "-o", str(tmp_path / "out.html")]
    assert main([*words, "--depth", "3", "--tolerances", "0.1"]) == 0
    assert "wrote" in capsys.readouterr().err
    assert (tmp_path / "out.html").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--port", "0"], "argument --port: must be a whole number from 1 to 65535; got 0"),
        (["--depth", "11"], "argument --depth: must be a whole number from 3 to 10; got 11"),
        (["--tolerances", "0.1,x"], "argument --tolerances: must be a number above 0 and at most 1; got x"),
        (["--guards", "0"], "argument --guards: must be a number above 0 and at most 1; got 0"),
        (["-o", "p.html", "--port", "9"], "--port must not be given with -o: a page has no server"),
        (["-o", "p.png"], "output must end in .html; got 'p.png'"),
    ],
)
def test_wrong_options_are_one_line(words, said, capsys):
    try:
        code = main(["view", "x.ply", *words])
    except SystemExit as end:
        code = end.code
    assert code == 2
    assert capsys.readouterr().err == f"voxkernel: error: {said} (see `voxkernel view --help`)\n"


@pytest.fixture(scope="module")
def viewer(prism):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with voxkernel.exact_kernel(prism).plot(prism, tolerances=[0.1], depth=3, browser=False) as viewer:
            yield viewer


@pytest.fixture
def taken():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


def test_a_port_that_is_taken_is_one_line(prism, taken, capsys):
    assert main(["view", "never-read.ply", "--no-browser", "--port", str(taken)]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert re.fullmatch(rf"voxkernel: error: --port must be free; got {taken}: .*in use\n", said.err)
    with pytest.raises(ValueError, match=rf"`port` must be free; got {taken}: .*in use"):
        prism.plot(port=taken)


def test_what_hinders_the_process_is_said(prism, monkeypatch):
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    with pytest.raises(voxkernel.SolverError, match="the viewer did not start: its process ended"):
        prism.plot(tolerances=[0.1], depth=3, browser=False)


@pytest.mark.slow
def test_plot_serves_from_a_process_of_its_own(viewer):
    import urllib.request

    assert viewer.is_open
    assert repr(viewer) == f"Viewer({viewer.url!r}, open)"
    assert f'<iframe src="{viewer.url}"' in viewer._repr_html_()
    assert b"<html" in urllib.request.urlopen(viewer.url, timeout=20).read()
    viewer.close()
    assert not viewer.is_open
    assert "closed" in viewer._repr_html_()
    viewer.close()


def test_a_kernel_without_its_surface_needs_faces():
    with pytest.raises(voxkernel.MeshError, match="`kernel` must have faces"):
        voxkernel.exact_kernel(shapes.torus(n_major=8, n_minor=6)).plot()


def test_a_relaxed_kernel_is_a_stop_of_its_own(prism):
    from voxkernel.view.shown import gathered

    given = voxkernel.voxel_kernel(prism, tolerance=0.2, depth=4)
    shown = gathered(prism, given, tolerances=[0.1, 0.2, 0.3], depth=3, domain=None, guards=None, title="")
    assert [getattr(kernel, "tolerance", 0.0) for kernel in shown.kernels] == [0.0, 0.1, 0.2, 0.3]
    assert shown.kernels[2] is given
    assert shown.title == "surface"
    assert np.allclose(shown.start, voxkernel.exact_kernel(prism).deepest_point)
