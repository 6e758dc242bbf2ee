import io
import json
import re
from collections import Counter
from html.parser import HTMLParser

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from markdown_it import MarkdownIt
from report_runs import (
    HOSTILE,
    add_thumbnail,
    add_view,
    cell_row,
    failed_row,
    large_run,
    load_rows,
    octahedron,
    png,
    surface_row,
    write_run,
)

import voxkernel.cli.main as command_line
from voxkernel.report import charts as charts
from voxkernel.report import write_report
from voxkernel.report.labels import star_truth
from voxkernel.report.page import shape_name, table_data
from voxkernel.report.pictures import Pictures, collect, spread_order
from voxkernel.report.rows import OUTCOMES, SCORES, worst_first
from voxkernel.report.text import code_span, json_block, one_line, percent, readable, shorten

FORMATS = {".html": "html", ".md": "markdown", ".json": "json"}


class Page(HTMLParser):
    """The elements, attributes and text of a page as a browser would find them."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.attributes, self.scripts, self.words = Counter(), [], {}, []
        self._open = None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags[tag] += 1
        self.attributes += [(tag, name, value) for name, value in attrs]
        if tag in ("script", "style"):
            self._open = (tag, dict(attrs).get("id", f"{tag}{self.tags[tag]}"))

    def handle_endtag(self, tag):
        if tag in ("script", "style"):
            self._open = None

    def handle_data(self, data):
        if self._open:
            self.scripts[self._open[1]] = self.scripts.get(self._open[1], "") + data
        else:
            self.words.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


@pytest.fixture
def run(tmp_path):
    return tmp_path / "run"


def html_of(run, tmp_path, **options):
    write_report(tmp_path / "report.html", run, **options)
    return (tmp_path / "report.html").read_text(encoding="utf-8")


def rows_of(page):
    return json.loads(page.scripts["rows"])


def cells(data, key):
    column = next(c for c in data["columns"] if c["key"] == key)
    return [column["words"][v] for v in column["values"]] if "words" in column else column["values"]


# ---------------------------------------------------------------- the summary


def test_summary_counts_what_is_in_the_table(run, rng, tmp_path):
    large_run(run, 600, rng)
    summary = write_report(tmp_path / "s.json", run)
    assert json.loads((tmp_path / "s.json").read_text()) == {"title": "run", **summary}
    rows = load_rows(str(run))
    assert summary["n_rows"] == 600 == sum(summary["counts"].values())
    assert summary["counts"] == {name: rows.outcome.count(name) for name in OUTCOMES}
    assert summary["failures"]["n"] == summary["counts"]["failed"] == 6
    assert [r["file"] for r in summary["failures"]["rows"]] == sorted(
        f for f, s in zip(rows.texts["file"], rows.texts["status"], strict=True) if s == "failed"
    )
    for score in SCORES:
        values = rows.numbers[score.column][[o != "failed" for o in rows.outcome]]
        assert summary["scores"][score.name]["quantiles"]["0.5"] == pytest.approx(np.median(values), rel=1e-12)
        assert summary["scores"][score.name]["n"] == 594
    defects = [row["defect"] for row in summary["worst"]]
    assert len(defects) == 10
    assert defects == sorted(rows.numbers["violation_upper"][:], key=lambda v: -np.nan_to_num(v))[:10]
    labels = summary["labels"]
    assert np.sum(labels["counts"]) == 600
    assert labels["truth"] is None
    assert {entry["label"] for entry in labels["roc"]} == set(labels["names"])
    assert "curve" not in labels["roc"][0]["scores"]["ratio"]


def tell_left_out(run, left_out):
    (run / "settings.json").write_text(json.dumps({"left_out": left_out}))


def test_files_left_out_are_told_wherever_the_run_tells(run, rng, tmp_path):
    write_run(run, [surface_row("a.ply", rng)])
    assert write_report(tmp_path / "s.json", run)["left_out"] is None  # an older run
    assert "left out by suffix" not in html_of(run, tmp_path)
    tell_left_out(run, {})
    assert write_report(tmp_path / "s.json", run)["left_out"] == []
    assert "left out by suffix" not in html_of(run, tmp_path)
    tell_left_out(run, {"": 1, ".txt": 2000, ".<b>": 1})
    summary = write_report(tmp_path / "s.md", run)
    assert summary["left_out"] == [{"suffix": s, "n": n} for s, n in ((".txt", 2000), ("", 1), (".<b>", 1))]
    told = "2,002 files left out by suffix: 2,000 {}, 1 without suffix, 1 {}."
    assert told.format("`.txt`", "<code>.&#60;b&#62;</code>") in (tmp_path / "s.md").read_text()
    page = html_of(run, tmp_path)
    assert told.format(".txt", ".<b>") in Page(page).text
    tell_left_out(run, {f".{k}": 1 for k in range(10)})
    write_report(tmp_path / "s.md", run)
    assert "10 files left out by suffix: " in (tmp_path / "s.md").read_text()
    assert ", 2 others." in (tmp_path / "s.md").read_text()


@pytest.mark.parametrize("left_out", [3, [".txt"], {".txt": "2"}, {".txt": -1}, {".txt": True}])
def test_left_out_files_that_cannot_be_counted(run, rng, tmp_path, left_out):
    write_run(run, [surface_row("a.ply", rng)])
    tell_left_out(run, left_out)
    with pytest.raises(ValueError, match=r"`left_out` in the settings of '.*run' must be a number of files for each"):
        write_report(tmp_path / "s.md", run)


def test_damaged_settings_are_one_line(run, rng, tmp_path, command):
    write_run(run, [surface_row("a.ply", rng)])
    (run / "settings.json").write_text("[" * 100_000)
    code, _, err = command("report", run, "-o", tmp_path / "a.md")
    assert (code, err.count("\n")) == (1, 1)
    assert "settings.json' must be the settings of a run" in err


def test_failures_come_before_anything_else(run, rng, tmp_path):
    rows = [surface_row(f"{i}.ply", rng) for i in range(9)]
    write_run(run, [*rows, failed_row("broken.ply", "truncated: 3 of 9 vertices"), failed_row("b2.ply", "timeout")])
    text = html_of(run, tmp_path)
    assert text.index('id="failures"') < text.index("<h2>Scores")
    assert "2 of 11 rows failed" in Page(text).text
    assert "truncated: 3 of 9 vertices" in Page(text).text
    write_report(tmp_path / "r.md", run)
    markdown = (tmp_path / "r.md").read_text()
    assert markdown.index("2 failed") < markdown.index("Scores")
    assert "`broken.ply`" in markdown


def test_equal_causes_are_counted_together(run, rng, tmp_path):
    rows = [failed_row(f"set/{i}.ply", f"'set/{i}.ply' cannot be read: the file is empty") for i in range(5)]
    rows += [failed_row(f"set/x{i}.ply", f"'x{i}.ply': the\n file  is empty") for i in range(3)]
    rows += [failed_row("set/y.ply", "'set/other.ply' is the same file"), failed_row("set/z.ply", "'set/z.ply'")]
    write_run(run, rows)
    assert write_report(tmp_path / "r.html", run)["failures"]["reasons"] == [
        {"reason": "cannot be read: the file is empty", "n": 5},
        {"reason": "the file is empty", "n": 3},
        {"reason": "'set/other.ply' is the same file", "n": 1},
        {"reason": "no reason was recorded", "n": 1},
    ]


@pytest.mark.parametrize(
    ("files", "folder"),
    [(["a/b/c.ply", "a/b/d.ply"], "a/b/"), (["a/b/c.ply", "a/bc/d.ply"], "a/"), (["a.ply", "b/a.ply"], ""),
     (["/x/a.ply", "/x/y/a.ply"], "/x/"), (["s3://bucket/a/1.ply", "s3://bucket/b/1.ply"], "s3://bucket/"),
     (["one.ply"], ""), ([], "")],
)  # fmt: skip
def test_the_common_folder_is_said_once(run, rng, tmp_path, files, folder):
    write_run(run, [surface_row(name, rng) for name in files])
    page = Page(html_of(run, tmp_path))
    assert rows_of(page)["folder"] == folder
    assert ("Files are in" in page.text) == bool(folder)


def test_many_different_reasons_stay_readable(run, rng, tmp_path):
    write_run(run, [failed_row(f"{i}.ply", f"reason {i} " + "x" * 3000) for i in range(400)])
    text = html_of(run, tmp_path)
    assert "and 388 more reasons" in Page(text).text
    assert text.count("<tr><td>") == 100
    write_report(tmp_path / "r.md", run)
    assert len((tmp_path / "r.md").read_text()) < 8000


def test_a_row_without_a_known_verdict_is_not_lost(run, rng, tmp_path):
    write_run(run, [surface_row("a.ply", rng), surface_row("b.ply", rng, kind="puzzling"), {"file": "c.ply"}])
    summary = write_report(tmp_path / "s.json", run)
    assert summary["counts"] == {"star-shaped": 1, "degenerate": 0, "not star-shaped": 0, "failed": 2}
    assert summary["failures"]["reasons"] == [{"reason": "no reason was recorded", "n": 2}]


@pytest.mark.parametrize("rows", [0, 1, "failed", "nothing known"])
def test_small_and_odd_runs(run, rng, tmp_path, rows):
    made = {
        0: [],
        1: [surface_row("one.ply", rng, label="a")],
        "failed": [failed_row("f.ply", label="a"), failed_row("g.ply", "", label="b")],
        "nothing known": [{"file": "n.ply", "status": "ok", "verdict": "star-shaped"}],
    }[rows]
    write_run(run, made)
    for suffix in FORMATS:
        summary = write_report(tmp_path / f"r{suffix}", run)
        assert summary["n_rows"] == len(made)
    page = Page((tmp_path / "r.html").read_text(encoding="utf-8"))
    assert rows_of(page)["n"] == len(made)


def test_cells_of_polyhedral_meshes(run, rng, tmp_path):
    write_run(run, [cell_row("mesh.vtu", k, rng) for k in range(50)] + [surface_row("a.ply", rng)])
    summary = write_report(tmp_path / "r.html", run)
    assert (summary["n_rows"], summary["n_cells"], summary["n_files"]) == (51, 50, 2)
    assert summary["scores"]["volume_share"]["n"] == summary["scores"]["inradius_over_diameter"]["n"] == 50
    page = Page((tmp_path / "r.html").read_text(encoding="utf-8"))
    assert "51 rows from 2 files. Some point sees the whole surface of 1 of the 1 surfaces that could be" in page.text
    assert "50 of the 50 cells of 1 volume mesh are star-shaped (100 %)." in page.text
    assert page.text.count("Inradius / diameter") == 1
    assert shape_name({"file": "mesh.vtu", "cell": 7}) == "mesh.vtu cell 7"
    write_report(tmp_path / "r.md", run)
    assert re.search(r"`mesh.vtu` cell \d+ \|", (tmp_path / "r.md").read_text())


def test_kinds_are_never_mixed(run, rng, tmp_path):
    """A thousand cells with a kernel must not hide that 9 of 10 surfaces have none."""
    made = [cell_row("good.vtu", k, rng) for k in range(900)]
    made += [cell_row("bad.vtu", k, rng, verdict="not star-shaped", ratio=0.0, volume_share=0.0) for k in range(100)]
    made += [surface_row(f"{k}.ply", rng, kind="not star-shaped" if k else "star-shaped") for k in range(10)]
    write_run(run, made, parts=3)
    summary = write_report(tmp_path / "r.html", run)
    assert {kind: own["n"] for kind, own in summary["kinds"].items()} == {"surface": 10, "cell": 1000}
    assert summary["kinds"]["surface"]["counts"]["not star-shaped"] == 9
    assert [summary["scores"][name]["n"] for name in ("ratio", "defect", "volume_share")] == [10, 10, 1000]
    assert {(pair["a"], pair["b"]) for pair in summary["spearman"]} == {
        ("ratio", "defect"), ("ratio", "visible"), ("defect", "visible"), ("volume_share", "inradius_over_diameter")
    }  # fmt: skip
    assert all(row["cell"] is None for row in summary["worst"])
    assert {row["file"] for row in summary["worst_cells"]} == {"bad.vtu"}
    bad, good = summary["volume_meshes"]
    assert (bad["file"], bad["n"], bad["counts"]["not star-shaped"], bad["smallest_share"]) == ("bad.vtu", 100, 100, 0)
    assert (good["file"], good["n"], good["counts"]["star-shaped"]) == ("good.vtu", 900, 900)
    page = Page((tmp_path / "r.html").read_text(encoding="utf-8"))
    assert "Some point sees the whole surface of 1 of the 10 surfaces that could be evaluated (10 %)." in page.text
    assert "900 of the 1,000 cells of 2 volume meshes are star-shaped (90 %)." in page.text
    assert "99" not in re.search(r"1,010 rows.*?No row failed", page.text[page.text.rindex("1,010 rows from") :])[0]
    write_report(tmp_path / "r.md", run)
    text = (tmp_path / "r.md").read_text()
    assert "| surfaces | 10 | 1 (10 %) | 0 (0 %) | 9 (90 %) | 0 (0 %) |" in text
    assert "| cells | 1,000 | 900 (90 %) | 0 (0 %) | 100 (10 %) | 0 (0 %) |" in text


def test_unverified_proofs_are_said_aloud(run, rng, tmp_path):
    write_run(run, [surface_row("a.ply", rng), surface_row("doubt.ply", rng, certificate_verified=False)])
    summary = write_report(tmp_path / "r.html", run)
    assert summary["certificates"]["not_verified"] == [{"file": "doubt.ply", "cell": None}]
    assert "1 answers whose proof was not confirmed" in Page((tmp_path / "r.html").read_text(encoding="utf-8")).text
    write_report(tmp_path / "r.md", run)
    assert "not confirmed" in (tmp_path / "r.md").read_text()


# ---------------------------------------------------------------- labels


def binary_run(run, rng, names=("star", "not star-shaped")):
    rows = [surface_row(f"s{i}.ply", rng, names[0]) for i in range(20)]
    rows += [surface_row(f"n{i}.ply", rng, names[1], "not star-shaped") for i in range(30)]
    rows += [surface_row("flat.ply", rng, names[0], "degenerate")]
    rows += [surface_row("wrong1.ply", rng, names[0], "not star-shaped"), surface_row("wrong2.ply", rng, names[1])]
    rows += [failed_row("f.ply", label=names[1]), surface_row("unlabelled.ply", rng)]
    return write_run(run, rows)


def test_binary_labels_make_a_confusion_matrix(run, rng, tmp_path):
    binary_run(run, rng)
    labels = write_report(tmp_path / "r.html", run)["labels"]
    truth = labels["truth"]
    assert truth["counts"] == [[20, 1, 1, 0], [1, 0, 30, 1]]
    assert truth["accuracy"] == pytest.approx(51 / 53)
    assert truth["sensitivity"] == pytest.approx(21 / 22)
    assert truth["specificity"] == pytest.approx(30 / 31)
    assert [row["file"] for row in truth["wrong"]] == ["wrong1.ply", "wrong2.ply"]
    assert labels["n_unlabelled"] == 1
    (roc,) = labels["roc"]
    rows = load_rows(str(run))
    own = [i for i in range(rows.n) if rows.texts["label"][i] and rows.outcome[i] != "failed"]
    star = [rows.texts["label"][i] == "star" for i in own]
    defect = rows.numbers["violation_upper"][own]
    won = [(a < b) + (a == b) / 2 for a, s in zip(defect, star, strict=True) if s
           for b, t in zip(defect, star, strict=True) if not t]  # fmt: skip
    assert roc["scores"]["defect"]["auc"] == pytest.approx(np.mean(won), abs=1e-12)
    text = Page((tmp_path / "r.html").read_text(encoding="utf-8")).text
    assert "51 agree with their label" in text
    assert "wrong1.ply : label star, verdict not star-shaped" in text
    write_report(tmp_path / "r.md", run)
    assert "51 of 53 verdicts agree" in (tmp_path / "r.md").read_text()


def test_star_labels_may_be_named(run, rng, tmp_path):
    binary_run(run, rng, names=("convex", "torus"))
    assert write_report(tmp_path / "r.json", run)["labels"]["truth"] is None
    truth = write_report(tmp_path / "r.json", run, star_labels=["convex"])["labels"]["truth"]
    assert (truth["star_labels"], truth["other_labels"], truth["n_right"]) == (["convex"], ["torus"], 51)
    with pytest.raises(ValueError, match=r"`star_labels` must be labels of the run; got \['cube'\]"):
        write_report(tmp_path / "r.json", run, star_labels=["cube"])


@pytest.mark.parametrize(
    ("names", "known"),
    [(("Star", "NON-STAR"), True), (("star_shaped", "not_star_shaped"), True), (("1", "0"), True),
     (("star", "near-star"), False), (("star", "star-shaped"), False), (("not", ""), False)],
)  # fmt: skip
def test_labels_that_are_understood(run, rng, names, known):
    write_run(run, [surface_row(f"{i}.ply", rng, name) for i, name in enumerate(names)])
    assert (star_truth(load_rows(str(run)), None) is not None) == known


def test_many_labels_are_bounded(run, rng, tmp_path):
    write_run(run, [surface_row(f"{i}.ply", rng, f"label {i % 300}") for i in range(900)])
    summary = write_report(tmp_path / "r.html", run)
    assert summary["labels"]["n_labels"] == 300
    assert len(summary["labels"]["names"]) == 24
    assert "the 24 most frequent of 300 labels" in Page((tmp_path / "r.html").read_text(encoding="utf-8")).text


# ---------------------------------------------------------------- charts


def test_histograms_hold_every_row(run, rng):
    large_run(run, 500, rng)
    rows = load_rows(str(run))
    for chart in charts.score_charts(rows, SCORES):
        assert sum(int(s["title"].split(": ")[1].split()[0].replace(",", "")) for s in chart.shapes) == 495
        assert all(chart.left <= s["x"] and s["x"] + s["w"] <= chart.right + 1 for s in chart.shapes)
        assert all(chart.top - 1 <= s["y"] and s["y"] + s["h"] <= chart.bottom + 1 for s in chart.shapes)


@given(st.lists(st.floats(1e-300, 1.0) | st.just(0.0), min_size=1, max_size=30), st.booleans())
def test_axes_keep_order_and_limits(values, is_log):
    array = np.array(values)
    axis = charts.Axis.over(array, 10.0, 210.0, is_log=is_log)
    places = [axis.place(v) for v in sorted(values)]
    assert places == sorted(places)
    assert 10.0 <= min(places) <= max(places) <= 210.0 + 1e-9
    ticks = axis.ticks()
    assert 2 <= len(ticks) <= 12
    assert all(10.0 - 1e-9 <= x <= 210.0 + 1e-9 for x, _ in ticks)
    assert charts._binned(array, axis.edges(), is_log).sum() == len(values)


def test_profile_bands_are_in_order(run, rng, tmp_path):
    odd = surface_row("odd.ply", rng, "a", profile_tolerances=[0.0, 1.0], profile_shares=[0.0, 1.0])
    broken = surface_row("broken.ply", rng, "a", profile_tolerances=[0.0, 1.0], profile_shares=[0.5])
    unknown = surface_row("unknown.ply", rng, "a", profile_shares=[float("nan")] * 26)
    write_run(run, [surface_row(f"{i}.ply", rng, "ab"[i % 2]) for i in range(40)] + [odd, broken, unknown])
    profile = write_report(tmp_path / "r.html", run)["profile"]
    assert (profile["n"], profile["n_other_tolerances"], len(profile["groups"])) == (40, 1, 2)
    for group in profile["groups"]:
        bands = np.array([group[q] for q in ("q10", "q25", "median", "q75", "q90")])
        assert (np.diff(bands, axis=0) >= 0).all()
    assert "1 rows with other tolerances" in Page((tmp_path / "r.html").read_text(encoding="utf-8")).text


def test_profiles_only_where_there_is_no_label(run, rng, tmp_path):
    rows = [surface_row(f"{i}.ply", rng) for i in range(5)]
    write_run(run, [*rows, surface_row("a.ply", rng, "a", profile_tolerances=None, profile_shares=None)])
    profile = write_report(tmp_path / "r.html", run)["profile"]
    assert [(group["label"], group["n"]) for group in profile["groups"]] == [("", 5)]


# ---------------------------------------------------------------- names are data


@pytest.fixture
def hostile(run, rng):
    """Hostile text in every column that comes from files."""
    rows = [surface_row(name, rng, label=name[:60], verdict_reason=name, notes=[name, name]) for name in HOSTILE]
    rows += [failed_row("bad/" + name, reason=name, label=name[:60]) for name in HOSTILE]
    rows[0].update(settings=HOSTILE[0], versions=json.dumps({HOSTILE[1]: HOSTILE[3]}), finished=HOSTILE[0])
    for row in rows[:6]:
        add_thumbnail(run, row)
        add_view(run, row)
    rows[7].update(thumbnail="<img>.png", view="</script>.npz")
    return write_run(run, rows)


def test_hostile_names_make_no_elements(hostile, rng, tmp_path):
    text = html_of(hostile, tmp_path, title=HOSTILE[0])
    page = Page(text)
    harmless = tmp_path / "harmless"
    rows = [surface_row(f"{i}.ply", rng, f"label {i}", notes=["n"]) for i in range(len(HOSTILE))]
    rows += [failed_row(f"bad{i}.ply", str(i), label=f"label {i}") for i in range(len(HOSTILE))]
    rows[0].update(settings="text", versions='{"a": 1}')
    for row in rows[:6]:
        add_thumbnail(harmless, row)
        add_view(harmless, row)
    rows[7].update(thumbnail="missing.png", view="missing.npz")
    plain = Page(html_of(write_run(harmless, rows), tmp_path))
    assert page.tags["script"] == plain.tags["script"]
    assert page.tags["img"] == page.tags["iframe"] == 0
    assert set(page.tags) == set(plain.tags)
    assert {(tag, name) for tag, name, _ in page.attributes} == {(tag, name) for tag, name, _ in plain.attributes}
    assert not [a for a in page.attributes if a[1].startswith("on")]
    names = cells(rows_of(page), "file")
    assert sorted(names) == sorted(readable(f) for n in HOSTILE for f in (n, "bad/" + n))
    assert "<script>alert(1)</script>.ply" in page.text
    assert "{{ 7*7 }}" in page.text
    assert "\\u202e" in page.text
    assert not re.search("[\x00-\x08\x0b-\x1f\u2028\u2029\u202e]", text)


def test_the_page_asks_for_nothing(hostile, tmp_path):
    page = Page(html_of(hostile, tmp_path))
    for tag, name, value in page.attributes:
        if name in ("src", "href", "action", "data", "srcset", "poster"):
            assert (tag, value) == ("link", "data:,")
    policy = next(v for _, n, v in page.attributes if n == "content" and "default-src" in v)
    assert "default-src 'none'" in policy
    assert "script-src 'sha256-" in policy
    assert "'unsafe-inline'" not in policy.split("script-src")[1]
    css = page.scripts["style1"]
    assert "url(" not in css
    assert "@import" not in css


def test_script_hashes_are_those_of_the_scripts(hostile, tmp_path):
    import base64
    import hashlib

    page = Page(html_of(hostile, tmp_path))
    policy = next(v for _, n, v in page.attributes if n == "content" and "default-src" in v)
    code = [body for key, body in page.scripts.items() if key.startswith("script")]
    assert len(code) == 2
    for body in code:
        digest = base64.b64encode(hashlib.sha256(body.encode()).digest()).decode()
        assert f"'sha256-{digest}'" in policy


def test_hostile_names_in_json_are_exact(hostile, tmp_path):
    summary = write_report(tmp_path / "r.json", hostile)
    text = (tmp_path / "r.json").read_text(encoding="utf-8")
    assert text.isascii()
    assert json.loads(text)["failures"] == summary["failures"]
    assert {r["file"] for r in summary["failures"]["rows"]} == {"bad/" + n for n in HOSTILE}


def test_hostile_names_in_markdown_are_text(hostile, tmp_path):
    write_report(tmp_path / "r.md", hostile, title=HOSTILE[8], n_worst=100)
    text = (tmp_path / "r.md").read_text(encoding="utf-8")
    html = MarkdownIt("commonmark").enable(["table", "strikethrough"]).render(text)
    page = Page(html)
    assert not {"a", "img", "script", "s", "em", "svg"} & set(page.tags)
    assert "@" not in text
    assert "://" not in text
    assert "www." not in text
    for table in html.split("<table>")[1:]:
        widths = {row.count("<td") + row.count("<th") - row.count("<thead") for row in table.split("<tr>")[1:]}
        assert len(widths) == 1
    words = "".join(page.words)
    for name in HOSTILE:
        assert " ".join(shorten(readable(name), 120).split()) in " ".join(words.split())


TEXT = st.text(st.characters(codec=None), max_size=60) | st.text("<>&|`*_[]()\\!#@:/.wW \n-", max_size=40)


@given(TEXT)
def test_any_text_in_a_markdown_table_is_one_cell(text):
    span = code_span(text)
    assert "\n" not in span
    html = MarkdownIt("commonmark").enable(["table", "strikethrough"]).render(f"| a | b |\n|---|---|\n| {span} | 1 |\n")
    page = Page(html.split("<tbody>")[1])
    assert page.tags["td"] == 2
    assert set(page.tags) <= {"tr", "td", "code"}
    shown = shorten(readable(text), 120)
    assert "".join("".join(page.words).split()) == "".join([*shown.split(), "1"])


@given(TEXT)
@example("</script><!--<script>&amp;")
def test_any_text_in_a_json_block(text):
    block = json_block({"name": text, text: [float("nan"), np.float64(1.5)]})
    assert block.isascii()
    assert not set("<>&\u2028") & set(block)
    assert json.loads(block)["name"] == text


@given(st.text(st.characters(codec=None)))
def test_readable_text_is_printable_and_can_be_written(text):
    assert readable(text).isprintable()
    assert "\n" not in one_line(text)
    readable(text).encode("utf-8")
    assert len(shorten(text, 20)) <= 20


def test_stray_bytes_of_a_name(run, rng, tmp_path):
    write_run(run, [surface_row("a.ply", rng)])
    for suffix in FORMATS:
        write_report(tmp_path / f"r{suffix}", run, title="run \udcff\ud800")
        assert "\\udcff" in (tmp_path / f"r{suffix}").read_text(encoding="utf-8").replace("&#92;", "\\")


# ---------------------------------------------------------------- pictures


def test_pictures_stay_within_their_bound(run, rng, tmp_path):
    rows = [add_thumbnail(run, surface_row(f"{i}.ply", rng), png() + bytes(30_000)) for i in range(40)]
    for row in rows[:20]:
        add_view(run, row)
    write_run(run, rows)
    text = html_of(run, tmp_path, max_megabytes=0.5, n_views=5)
    assert len(text) < 650_000
    data = rows_of(Page(text))
    assert len(data["views"]) == 5
    assert set(data["views"]) <= set(data["pictures"])
    assert 5 < len(data["pictures"]) < 40
    assert f"{40 - len(data['pictures'])} more thumbnails are in the run" in Page(text).text
    none = rows_of(Page(html_of(run, tmp_path, max_megabytes=0)))
    assert none["views"] == none["pictures"] == []
    assert rows_of(Page(html_of(run, tmp_path, n_views=0)))["views"] == []
    assert "makeViewer = " not in html_of(run, tmp_path, n_views=0)
    assert "makeViewer = " in html_of(run, tmp_path)


def test_views_hold_the_arrays(run, rng, tmp_path):
    import base64

    vertices, faces = octahedron(2.0, (10, 20, 30))
    row = add_view(run, surface_row("a.ply", rng), vertices=vertices, faces=faces)
    write_run(run, [row])
    view = json.loads(Page(html_of(run, tmp_path)).scripts["view-0"])
    assert np.array_equal(np.frombuffer(base64.b64decode(view["vertices"]), "<f4").reshape(-1, 3), vertices)
    assert np.array_equal(np.frombuffer(base64.b64decode(view["faces"]), "<u4").reshape(-1, 3), faces)


BAD_VIEWS = {
    "an index too large": {"faces": np.array([[0, 1, 6]])},
    "a negative index": {"kernel_faces": np.array([[0, 1, -1]])},
    "not finite": {"vertices": np.full((6, 3), np.nan)},
    "fractions for faces": {"faces": np.array([[0.0, 1.0, 2.5]])},
    "objects": {"vertices": np.array([{"a": 1}], dtype=object)},
    "no faces": {"faces": np.empty((0, 3), np.int32)},
    "a wrong shape": {"vertices": np.zeros((5, 2))},
}


@pytest.mark.parametrize("name", BAD_VIEWS)
def test_damaged_views_cost_only_themselves(run, rng, tmp_path, name):
    write_run(
        run, [add_view(run, surface_row("a.ply", rng), **BAD_VIEWS[name]), add_view(run, surface_row("b.ply", rng))]
    )
    page = Page(html_of(run, tmp_path))
    assert rows_of(page)["views"] == [1]
    assert "1 pictures or views could not be read, the first: views/" in page.text


@pytest.mark.parametrize("path", ["../secret.png", "/etc/secret.png", "a/../../secret.png", "missing.png", "C:/x.png",
                                  "file:///secret.png", "..\\secret.png", "", "thumbnails/text.png"])  # fmt: skip
def test_only_pictures_of_the_run_are_embedded(run, rng, tmp_path, path):
    (tmp_path / "secret.png").write_bytes(png())
    (run / "thumbnails").mkdir(parents=True)
    (run / "thumbnails/text.png").write_bytes(b"<svg onload=alert(1)>")
    write_run(run, [surface_row("a.ply", rng, thumbnail=path, view=path)])
    data = rows_of(Page(html_of(run, tmp_path)))
    assert data["pictures"] == data["views"] == []


def test_a_truncated_view_is_no_view(run, rng, tmp_path):
    row = add_view(run, surface_row("a.ply", rng))
    whole = (run / row["view"]).read_bytes()
    write_run(run, [row])
    for cut in (b"", whole[:10], whole[: len(whole) // 2], whole[:-30], b"\x80\x04" + whole):
        (run / row["view"]).write_bytes(cut)
        assert rows_of(Page(html_of(run, tmp_path)))["views"] == []
    stream = io.BytesIO()
    np.save(stream, np.zeros(3))
    (run / row["view"]).write_bytes(stream.getvalue())
    assert rows_of(Page(html_of(run, tmp_path)))["views"] == []


@pytest.mark.parametrize("depth", [9, 300, 900, 100_000])
def test_nested_settings_are_shown_as_text(run, rng, tmp_path, command, depth):
    text = "[" * depth + "1" + "]" * depth
    write_run(run, [surface_row("a.ply", rng, settings=text), surface_row("b.ply", rng)])
    for suffix in ("html", "md", "json"):
        summary = write_report(tmp_path / f"a.{suffix}", run)
    assert text in [entry["value"] for entry in summary["settings"]]
    code, _, _ = command("report", run, "-o", tmp_path / "b.html")
    assert code == 0


@pytest.mark.parametrize("damage", [b"", b"PAR1", b"no table", None])
def test_damaged_parts_are_one_line(run, rng, tmp_path, command, damage):
    write_run(run, [surface_row("a.ply", rng)])
    (part,) = (run / "rows").iterdir()
    raw = part.read_bytes()
    for k in range(1 if damage is not None else 40):
        spoilt = bytearray(raw)
        for at in np.random.default_rng(k).integers(0, len(raw), 8):
            spoilt[at] ^= 0x5A
        part.write_bytes(bytes(spoilt) if damage is None else damage)
        code, _, err = command("report", run, "-o", tmp_path / "a.json")
        assert code == 1 or (code == 0 and damage is None)
        assert err.count("\n") == 1
        assert code == 0 or "must be a part of a run" in err


def test_the_chosen_shapes_are_spread(run, rng):
    large_run(run, 400, rng)
    rows = load_rows(str(run))
    order = spread_order(rows)
    assert sorted(order) == list(range(rows.n))
    groups = {(rows.texts["label"][i], rows.outcome[i]) for i in range(rows.n)}
    assert {(rows.texts["label"][i], rows.outcome[i]) for i in order[: len(groups)]} == groups
    worst = worst_first(rows, range(rows.n))
    assert rows.numbers["violation_upper"][worst[0]] == np.nanmax(rows.numbers["violation_upper"])
    last, first = [i for i in range(rows.n) if rows.texts["view"][i]][:2]
    found = collect(str(run), rows, n_views=6, max_bytes=10**7, first=[first, last])
    assert len(found.views) == 6
    assert list(found.views)[:2] == [first, last]


# ---------------------------------------------------------------- size, formats, errors


def test_ten_thousand_rows_are_a_small_page(run, rng, tmp_path):
    large_run(run, 10_000, rng)
    text = html_of(run, tmp_path)
    assert len(text) < 4_000_000
    page = Page(text)
    assert page.tags["tr"] < 150
    data = rows_of(page)
    rows = load_rows(str(run))
    assert cells(data, "outcome") == rows.outcome
    ratio = np.array([np.nan if v is None else v for v in cells(data, "ratio")])
    np.testing.assert_allclose(ratio, rows.numbers["ratio"], rtol=1e-5)
    assert all(len(c["values"]) == 10_000 for c in data["columns"])
    assert "cell" not in [c["key"] for c in table_data(rows, Pictures())["columns"]]


def test_a_run_may_be_a_url(rng, tmp_path):
    url = "memory://report-test/run"
    write_run(url, [add_view(url, add_thumbnail(url, surface_row("a.ply", rng)))])
    text = html_of(url, tmp_path)
    assert rows_of(Page(text))["views"] == rows_of(Page(text))["pictures"] == [0]
    assert "<h1>run</h1>" in text


def test_errors(run, rng, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"`run` must be the output of an evaluation; got .*does not exist"):
        write_report(tmp_path / "r.html", tmp_path / "nothing")
    (tmp_path / "folder").mkdir()
    with pytest.raises(FileNotFoundError, match="which has no rows"):
        write_report(tmp_path / "r.html", tmp_path / "folder")
    write_run(run, [surface_row("a.ply", rng)])
    endings = "`path` must end in .html, .md, .json or .tex, or `format` be given; got 'r.pdf'"
    with pytest.raises(ValueError, match=endings):
        write_report(tmp_path / "r.pdf", run)
    with pytest.raises(ValueError, match="`format` must be one of html, markdown, json, latex; got 'pdf'"):
        write_report(tmp_path / "r.html", run, format="pdf")
    with pytest.raises(ValueError, match="`n_views` must be 0 or more; got -1"):
        write_report(tmp_path / "r.html", run, n_views=-1)
    with pytest.raises(ValueError, match="`max_megabytes` must be 0 or more; got nan"):
        write_report(tmp_path / "r.html", run, max_megabytes=float("nan"))
    with pytest.raises(FileNotFoundError, match="`path` must be in an existing folder"):
        write_report(tmp_path / "no/r.html", run)
    assert not [p for p in tmp_path.iterdir() if p.name.endswith(".tmp")]
    assert write_report(tmp_path / "r.txt", run, format="markdown", n_worst=0)["worst"] == []


def test_reports_do_not_change_between_calls(run, rng, tmp_path):
    large_run(run, 200, rng)
    for suffix in FORMATS:
        write_report(tmp_path / f"a{suffix}", run)
        write_report(tmp_path / f"b{suffix}", run)
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_words():
    assert [percent(k, 1000) for k in (0, 1, 1000)] == ["0 %", "0.1 %", "100 %"]
    assert percent(1, 100_000) == "< 0.1 %"
    assert percent(99_999, 100_000) == "> 99.9 %"
    assert percent(0, 0) == "–"
    assert shorten("abcdefghij", 5) == "ab…ij"
    assert code_span("folder/mesh 01.ply") == "`folder/mesh 01.ply`"


# ---------------------------------------------------------------- command line


@pytest.fixture
def command(capsys):
    def call(*words):
        try:
            code = command_line.main([str(word) for word in words])
        except SystemExit as stop:
            code = stop.code
        said = capsys.readouterr()
        return code, said.out, said.err

    return call


def test_command_writes_each_format(run, rng, tmp_path, command):
    write_run(run, [surface_row("a.ply", rng, "x"), failed_row("b.ply", label="y")])
    for suffix in FORMATS:
        code, out, err = command("report", run, "-o", tmp_path / f"r{suffix}")
        assert (code, out) == (0, "")
        assert "2 rows (1 star-shaped, 0 degenerate, 0 not star-shaped, 1 failed)" in err
    assert (tmp_path / "r.html").read_text(encoding="utf-8").startswith("<!doctype html>")
    code, out, err = command("report", run, "--json", "--quiet")
    assert (code, err) == (0, "")
    assert json.loads(out) == json.loads((tmp_path / "r.json").read_text())
    code, out, err = command("report", run, "--markdown", "--title", "Pull <request>")
    assert (code, err) == (0, "")
    assert out.startswith("## voxkernel report: <code>Pull &#60;request&#62;</code>")
    assert command("report", run, "--star-label", "x", "--json")[0] == 0


def test_command_refuses_bad_usage(run, rng, tmp_path, command):
    write_run(run, [surface_row("a.ply", rng)])
    cases = [
        (("report", run), "-o FILE must be given"),
        (("report", run, "-o", tmp_path / "r.pdf"), "must end in .html, .htm, .md, .json, .tex; got"),
        (("report", run, "-o", tmp_path / "no/r.html"), "must be in an existing folder"),
        (("report", run, "-o", tmp_path / "r.html", "--views", "-1"), "must be a whole number"),
        (("report", run, "-o", tmp_path / "r.html", "--max-megabytes", "nan"), "number of megabytes"),
        (("report", run, "--json", "--markdown"), "not allowed with"),
    ]
    for words, said in cases:
        code, out, err = command(*words)
        assert (code, out) == (2, "")
        assert said in err
        assert err.count("\n") == 1
    code, out, err = command("report", tmp_path / "missing", "--json")
    assert (code, out) == (1, "")
    assert "does not exist" in err
