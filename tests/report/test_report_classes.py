"""Classes by thresholds, two runs side by side, and LaTeX: known answers on runs made by formula."""

import json
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from report_runs import HOSTILE, add_thumbnail, cell_row, failed_row, load_rows, surface_row, write_run

import voxkernel.cli.main as command_line
from voxkernel.report import write_report
from voxkernel.report.classes import class_rules
from voxkernel.report.latex import escaped
from voxkernel.report.page import table_data
from voxkernel.report.pictures import Pictures


def with_defect(file, rng, defect, label="", **more):
    kind = "star-shaped" if defect == 0.0 else "not star-shaped"
    row = surface_row(file, rng, label, kind)
    return {**row, "violation_upper": defect, "violation_lower": defect, **more}


@pytest.fixture
def run(tmp_path, rng):
    rows = [
        with_defect("a.ply", rng, 0.0, "star"), with_defect("b.ply", rng, 0.005, "near"),
        with_defect("c.ply", rng, 0.01, "near"), with_defect("d.ply", rng, 0.2, "far"),
        failed_row("e.ply", label="far"), cell_row("cells.vtu", 3, rng),
    ]  # fmt: skip
    return write_run(tmp_path / "run", rows)


CLASSES = ["star: defect=0", "near: defect < 0.01 n_facets>=1; far: defect>=0.1"]


def test_a_row_is_of_the_first_class_that_holds(run, tmp_path):
    found = write_report(tmp_path / "r.json", run, classes=CLASSES)["classes"]
    assert found["names"] == ["star", "near", "far", "none of these", "failed"]
    assert found["kinds"] == {"surface": [1, 1, 1, 1, 1], "cell": [1, 0, 0, 0, 0]}
    assert found["labels"]["names"] == ["far", "near", "star"]
    assert found["labels"]["counts"] == [[0, 0, 1, 0, 1], [0, 1, 0, 1, 0], [1, 0, 0, 0, 0]]
    agreement = found["labels"]["agreement"]
    assert (agreement["n"], agreement["n_right"], agreement["accuracy"]) == (4, 3, 0.75)
    assert agreement["each"]["near"] == {"recall": 0.5, "precision": 1.0}


def test_labels_that_are_no_classes_agree_with_nothing(run, tmp_path):
    found = write_report(tmp_path / "r.json", run, classes=["nearly: defect<0.01"])["classes"]
    assert found["labels"]["agreement"] is None
    assert [sum(row) for row in found["labels"]["counts"]] == [2, 2, 1]


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("defect<0.01", "a name, a colon and comparisons.*got 'defect<0.01'"),
        ("near: defect<", "a name, a colon and comparisons"),
        ("near: defect<0.1 or ratio>0", "a name, a colon and comparisons"),
        ("near: defect<0.1; near: defect<0.2", "names of their own; got 'near' twice"),
        ("failed: defect<0.1", "names of their own; got 'failed' twice"),
        (" ; ", "at least one class; got none"),
    ],
)
def test_classes_that_cannot_be_read(text, match):
    with pytest.raises(ValueError, match=match):
        class_rules([text])


def test_a_class_compares_numbers_only(run, tmp_path, capsys):
    with pytest.raises(ValueError, match=r"`classes` must compare scores \(ratio, defect, .*; got 'label'"):
        write_report(tmp_path / "r.json", run, classes=["x: label=1"])
    assert command_line.main(["report", run, "-o", str(tmp_path / "r.md"), "--classes", "near: defect"]) == 2
    assert "--classes must be a name, a colon" in capsys.readouterr().err


def test_names_with_colons_and_all_comparisons():
    (rule,) = class_rules(["a: b : defect<=1e-3, ratio>.5 visible>=0.9"])
    assert rule.name == "a: b"
    assert rule.conditions == (("defect", "<=", 1e-3), ("ratio", ">", 0.5), ("visible", ">=", 0.9))


# ---------------------------------------------------------------- two runs


@pytest.fixture
def two_runs(tmp_path, rng):
    before = [
        with_defect("same.ply", rng, 0.02), with_defect("worse.ply", rng, 0.0), with_defect("better.ply", rng, 0.1),
        with_defect("moved.ply", rng, 0.03), with_defect("unproven.ply", rng, 0.0), with_defect("lost.ply", rng, 0.1),
        with_defect("broke.ply", rng, 0.1),
    ]  # fmt: skip
    now = [
        {**before[0]}, {**before[1], "verdict": "not star-shaped", "violation_upper": 0.04, "ratio": 0.0},
        {**before[2], "verdict": "star-shaped", "violation_upper": 0.0}, {**before[3], "violation_upper": 0.05},
        {**before[4], "certificate_verified": False}, with_defect("new.ply", rng, 0.1),
        failed_row("broke.ply", "took longer than 300 s"),
    ]  # fmt: skip
    return write_run(tmp_path / "now", now), write_run(tmp_path / "before", before)


def test_regressions_are_worse_verdicts_failures_and_lost_proofs(two_runs, tmp_path):
    found = write_report(tmp_path / "r.json", two_runs[0], compare=two_runs[1])["comparison"]
    assert (found["n_now"], found["n_before"], found["n_both"], found["matched_by"]) == (7, 7, 6, "name")
    assert found["only_now"] == {"n": 1, "rows": ["new.ply"]}
    assert found["only_before"] == {"n": 1, "rows": ["lost.ply"]}
    assert [row["name"] for row in found["regressions"]["rows"]] == ["worse.ply", "broke.ply", "unproven.ply"]
    assert [row["proof_lost"] for row in found["regressions"]["rows"]] == [False, True, True]
    assert found["regressions"]["rows"][0]["scores"]["defect"] == [0.0, 0.04]
    assert [row["name"] for row in found["improvements"]["rows"]] == ["better.ply"]
    assert found["n_changed"] == 3  # the proof that was lost is no other verdict
    assert np.array(found["counts"]).tolist() == [[1, 0, 1, 0], [0, 0, 0, 0], [1, 0, 2, 1], [0, 0, 0, 0]]
    defect = found["scores"]["defect"]
    assert (defect["n"], defect["n_equal"], defect["n_better"], defect["n_worse"]) == (5, 2, 1, 2)
    assert defect["largest_change"] == 0.1
    assert defect["largest"] == "better.ply"


def test_a_run_against_itself_changes_nothing(run, tmp_path):
    found = write_report(tmp_path / "r.json", run, compare=run)["comparison"]
    assert found["n_both"] == found["n_now"] == 6
    assert (found["n_changed"], found["regressions"]["n"], found["improvements"]["n"]) == (0, 0, 0)
    assert all(m["n_equal"] == m["n"] for m in found["scores"].values())
    assert found["same_settings"]
    assert found["same_versions"]


def test_runs_of_moved_folders_are_matched_below_them(tmp_path, rng):
    rows = [with_defect(f"{name}.ply", rng, 0.1) for name in "abc"]
    one = write_run(tmp_path / "one", [{**row, "file": f"old/place/{row['file']}"} for row in rows])
    two = write_run(tmp_path / "two", [{**row, "file": f"/new/{row['file']}"} for row in rows])
    found = write_report(tmp_path / "r.json", two, compare=one)["comparison"]
    assert found["n_both"] == 3
    assert found["matched_by"] == "name below the common folder"


def test_runs_without_a_common_row(tmp_path, rng):
    one = write_run(tmp_path / "one", [with_defect("a.ply", rng, 0.1)])
    two = write_run(tmp_path / "two", [with_defect("b.obj", rng, 0.1), cell_row("c.vtu", 1, rng)])
    found = write_report(tmp_path / "r.html", two, compare=one)["comparison"]
    assert (found["n_both"], found["only_now"]["n"], found["only_before"]["n"]) == (0, 2, 1)
    assert found["scores"] == {}


def test_the_other_run_must_be_there(run, tmp_path):
    with pytest.raises(FileNotFoundError, match="must be the output of an evaluation"):
        write_report(tmp_path / "r.html", run, compare=tmp_path / "nothing")


def test_page_and_markdown_show_both(two_runs, tmp_path):
    write_report(tmp_path / "r.html", two_runs[0], compare=two_runs[1], classes=["near: defect<0.05"])
    page = (tmp_path / "r.html").read_text()
    rows = json.loads(re.search(r'id="rows">(.*?)</script>', page, re.S)[1])
    columns = {c["key"]: [c["words"][v] for v in c["values"]] if "words" in c else c["values"] for c in rows["columns"]}
    place = {name: k for k, name in enumerate(columns["file"])}
    assert columns["before"][place["new.ply"]] == "not in the other run"
    assert columns["before"][place["worse.ply"]] == "star-shaped"
    assert columns["class"][place["moved.ply"]] == "none of these"
    assert columns["defect_change"][place["moved.ply"]] == pytest.approx(0.02)
    assert "3 verdicts changed: 3 regressions, 1 improvements" in page
    write_report(tmp_path / "r.md", two_runs[0], compare=two_runs[1], classes=["near: defect<0.05"])
    text = (tmp_path / "r.md").read_text()
    assert "| `worse.ply` | star-shaped | not star-shaped | 0 → 0.04 |" in text
    assert "| surfaces | 4 | 2 | 1 |" in text


def test_columns_of_classes_only_where_asked(run):

    keys = [c["key"] for c in table_data(load_rows(run), Pictures())["columns"]]
    assert not {"class", "before", "ratio_change"} & set(keys)


# ---------------------------------------------------------------- LaTeX


def test_latex_tables_and_figures(two_runs, tmp_path):
    pytest.importorskip("matplotlib")
    write_report(tmp_path / "two runs.tex", two_runs[0], compare=two_runs[1], classes=["near: defect<0.05"])
    text = (tmp_path / "two runs.tex").read_text(encoding="ascii")
    for rule in ("toprule", "midrule", "bottomrule"):
        assert text.count(rf"\{rule}") == text.count(r"\begin{tabular}") == 5
    assert r"surfaces & 7 & 2 & 0 & 4 & 1 \\" in text
    assert r"star{-}shaped" not in text  # our own words are not escaped
    for block in re.findall(r"\\begin{tabular}{(l+r+)}(.*?)\\end{tabular}", text, re.S):
        lines = [line for line in block[1].splitlines() if line.endswith(r"\\")]
        assert {line.count("&") for line in lines} == {len(block[0]) - 1}
    (name,) = re.findall(r"\\includegraphics\[.*\]{(.*)}", text)
    assert name == "two-runs-surfaces.pdf"
    assert (tmp_path / name).read_bytes().startswith(b"%PDF-")
    svg = ElementTree.parse(tmp_path / "two-runs-surfaces.svg").getroot()
    assert svg.tag.endswith("svg")
    words = {"".join(e.itertext()).strip() for e in svg.iter() if e.tag.endswith("text")}
    assert {"ratio", "defect", "visible"} <= words


def test_figures_are_the_same_twice(run, tmp_path):
    pytest.importorskip("matplotlib")
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_report(tmp_path / name / "r.tex", run)
    for suffix in ("pdf", "svg"):
        first, second = ((tmp_path / name / f"r-surfaces.{suffix}").read_bytes() for name in ("a", "b"))
        assert first == second


@pytest.mark.parametrize("name", HOSTILE)
def test_no_name_is_a_command(name):
    """Every letter that LaTeX would take for more than itself is behind a backslash or in a command of ours."""
    text = escaped(name, 5000)
    left = re.sub(r"\\(text[a-z]+\{\}|[{}$&#%_])|\{-\}", "", text)
    assert not set(left) & set("\\{}$&#%_^~<>|\"'`")
    assert text.isprintable()


def test_latex_goes_to_standard_output_without_figures(run, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert command_line.main(["report", run, "--latex"]) == 0
    assert r"\toprule" in capsys.readouterr().out
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run"]


def test_thumbnails_stay_in_the_table(tmp_path, rng):
    run = str(tmp_path / "run")
    row = add_thumbnail(run, with_defect("a.ply", rng, 0.1))
    write_run(run, [row])
    write_report(tmp_path / "r.html", run, classes=["near: defect<1"])
    assert '"pictures":[0]' in (tmp_path / "r.html").read_text()
