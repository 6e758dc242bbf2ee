"""The report as one HTML page: what the template needs, and nothing a file says as markup."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from voxkernel._extras import optional
from voxkernel._plain import json_text
from voxkernel.report import charts as charts
from voxkernel.report.objects import object_charts, worst_objects
from voxkernel.report.pictures import Pictures
from voxkernel.report.rows import ALL_SCORES, CELL_SCORES, LABEL_SCORES, SCORES, ReportRows, Score
from voxkernel.report.text import count, json_block, left_out_text, number, one_line, percent, readable, shorten

__all__ = ["render_page", "shape_name"]

# key, title, width in the table ("" only among the facts of one shape), hint
_COLUMNS = (
    ("file", "File", "auto", "name as given to the evaluation"),
    ("label", "Label", "110px", ""),
    ("outcome", "Verdict", "196px", ""),
    ("class", "Class", "150px", "by the thresholds that were given"),
    ("before", "Before", "150px", "verdict in the other run"),
    ("ratio_change", "Ratio moved", "112px", "ratio now minus before"),
    ("defect_change", "Defect moved", "118px", "defect now minus before"),
    ("ratio", "Ratio", "88px", SCORES[0].meaning),
    ("violation_upper", "Defect", "92px", SCORES[1].meaning),
    ("visible_fraction", "Visible", "90px", SCORES[2].meaning),
    ("volume_share", "Volume share", "126px", CELL_SCORES[0].meaning),
    ("inradius_over_diameter", "Inradius / d.", "124px", CELL_SCORES[1].meaning),
    ("voxels_seen", "Seen", "88px", LABEL_SCORES[0].meaning),
    ("shortfall", "Falls short by", "120px", "the main cause; 'Details' lists all that hold"),
    ("overlap", "Overlap", "92px", "largest intersection over union of up to 96 rays from the best voxel"),
    ("rays_for_80", "Rays for 0.8", "110px", "that bring the overlap to 0.8; never: none of those tried"),
    ("voxels", "Voxels", "88px", ""),
    ("n_facets", "Facets", "88px", ""),
    ("seconds", "Seconds", "98px", ""),
    ("reason", "Failed because", "", ""),
    ("kind", "Kind", "", ""),
    ("cell", "Cell", "", ""),
    ("object", "Object", "", "number in the label image"),
    ("shortfall_detail", "All causes", "", ""),
    ("verdict_reason", "Why not star-shaped", "", ""),
    ("notes", "Notes", "", ""),
    ("dimension", "Kernel dimension", "", ""),
    ("volume", "Kernel volume", "", ""),
    ("volume_lower", "at least", "", ""),
    ("volume_upper", "at most", "", ""),
    ("reference", "Ratio divides by", "", ""),
    ("reference_volume", "Reference volume", "", ""),
    ("clearance", "Clearance of the centre", "", ""),
    ("domain", "Domain", "", ""),
    ("cut_by_domain", "Kernel cut by the domain", "", ""),
    ("violation_lower", "Defect at least", "", ""),
    ("visible_lower", "Visible at least", "", ""),
    ("visible_upper", "Visible at most", "", ""),
    ("guards", "Guards", "", ""),
    ("guards_seen", "Seen by guards", "", ""),
    ("guards_certified", "Seen by certificate", "", ""),
    ("guards_reason", "Guards fall short because", "", ""),
    ("inradius", "Inradius", "", ""),
    ("certificate_kind", "Certificate", "", ""),
    ("certificate_verified", "Proof confirmed", "", ""),
    ("certificate_facets", "Facets of the proof", "", ""),
    ("center_x", "Deepest point", "", ""),
    ("center_y", "Centre y", "", ""),
    ("center_z", "Centre z", "", ""),
    ("star_center_x", "Star centre", "", ""),
    ("star_center_y", "Star centre y", "", ""),
    ("star_center_z", "Star centre z", "", ""),
    ("n_vertices", "Vertices", "", ""),
    ("n_faces", "Faces", "", ""),
    ("n_components", "Components", "", ""),
    ("n_boundary_edges", "Boundary edges", "", ""),
    ("n_nonmanifold_edges", "Non-manifold edges", "", ""),
    ("n_degenerate", "Facets without area", "", ""),
    ("genus", "Genus", "", ""),
    ("is_closed", "Closed", "", ""),
    ("is_oriented", "Oriented", "", ""),
    ("is_outward", "Outward", "", ""),
    ("area", "Area", "", ""),
    ("enclosed_volume", "Enclosed volume", "", ""),
    ("diagonal", "Diagonal", "", ""),
    ("voxels_seen_upper", "Seen at most", "", ""),
    ("center_index", "Best voxel", "", ""),
    ("center_world", "Best voxel in the world", "", ""),
    ("seen_deepest", "Seen from the deepest voxel", "", ""),
    ("seen_centroid", "Seen from the centroid", "", ""),
    ("n_rays", "Numbers of rays", "", ""),
    ("iou", "Overlap of each", "", ""),
    ("iou_stepped", "The same, as StarDist ends rays", "", ""),
    ("rays_for_90", "Rays for 0.9", "", ""),
    ("elongation", "Elongation", "", ""),
    ("n_fragments", "Fragments", "", ""),
    ("n_holes", "Holes", "", ""),
    ("hole_voxels", "Voxels of holes", "", ""),
    ("touches_border", "Touches the border", "", ""),
    ("box_low", "Box from", "", ""),
    ("box_high", "Box to, not with", "", ""),
    ("spacing", "Spacing", "", ""),
    ("finished", "Finished", "", ""),
)
_TRUTHS = ("cut_by_domain", "certificate_verified", "is_closed", "is_oriented", "is_outward", "touches_border")
_NEVER = ("rays_for_80", "rays_for_90")  # 0 where no number that was tried is enough
_ON_REQUEST = ("class", "before", "ratio_change", "defect_change")  # with classes, or another run
_WHOLE = ("verdict_reason", "shortfall_detail", "notes")
_DIGITS = 6
_ENDS, _FILE = 188, 240  # pixels of the columns at both ends, and at least of the file
_WORST = 24  # pictures of objects


def render_page(
    rows: ReportRows, summary: dict[str, Any], pictures: Pictures, *, title: str, chosen: Sequence[int],
    shown: ReportRows | None = None, beside: str = "",
) -> str:  # fmt: skip
    """Write the page.

    `title` is any text; `shown` are the rows of its table, all by default, to which `pictures` and `chosen`, those of
    the gallery, belong; `beside` is the file with all of them, where the page shows a part.
    """
    shown = rows if shown is None else shown
    from importlib.resources import files

    jinja2 = optional("jinja2")
    folder = files("voxkernel.report") / "templates"

    def read(name: str) -> str:
        return (folder / name).read_text(encoding="utf-8")

    # A template from a dictionary: packages in a zip have no folder.
    names = ("report.html", "report_macros.html", "report_sheet.html")
    environment = jinja2.Environment(
        loader=jinja2.DictLoader({name: read(name) for name in names}),
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    filters: dict[str, Any] = environment.filters
    filters.update(
        px=_pixels, count=count, number=number, one_line=one_line, readable=readable,
        percent=percent, shorten=shorten, shape_name=shape_name, pretty=_pretty, score_title=_score_title, time=_time,
    )  # fmt: skip
    shared = common_folder(rows)
    scripts = [read("report_viewer.js"), read("report.js")] if chosen else [read("report.js")]
    return environment.get_template("report.html").render(
        s=summary, title=readable(title), headline=_headline(summary), bar=charts.outcome_bar(_main_counts(summary)),
        bar_of=_bar_title(summary), classes=list(charts.CLASS_OF.values()), kinds=list(summary["kinds"]),
        scores=charts.score_charts(rows.only("surface"), SCORES), ranks=_matrix(summary, SCORES),
        cell_scores=charts.score_charts(rows.only("cell"), CELL_SCORES), cell_ranks=_matrix(summary, CELL_SCORES),
        profiles=charts.profile_charts(summary["profile"]), rocs=charts.roc_charts(summary["labels"]),
        boxes=charts.boxes(summary["labels"]), shown_scores=_shown_scores,
        object_charts=[*object_charts(summary["objects"]), *charts.score_charts(rows.only("object"), LABEL_SCORES)],
        worst=[_card(shown, pictures, i, shared) for i in worst_objects(shown, _WORST) if i in pictures.thumbnails],
        gallery=[_card(shown, pictures, i, shared) for i in chosen], n_shown=shown.n, beside=readable(beside),
        folder=shared, left_out=left_out_text([(group["suffix"], group["n"]) for group in summary["left_out"] or ()]),
        views_left_out=pictures.views_left_out, pictures_note=_pictures_note(pictures), css=read("report.css"),
        scripts=scripts, script_hashes=" ".join(_hash(script) for script in scripts),
        rows_json=json_block(table_data(shown, pictures)), pictures_json=json_block(pictures.thumbnails),
        views_json=[(i, json_block(view)) for i, view in pictures.views.items()],
    )  # fmt: skip


def table_data(rows: ReportRows, pictures: Pictures) -> dict[str, Any]:
    """Give the columns that hold anything, compactly: repeated words once, numbers to six digits."""
    columns: list[dict[str, Any]] = []
    for key, title, width, hint in _COLUMNS:
        if key in _ON_REQUEST and key not in rows.texts and key not in rows.numbers:
            continue
        values, kind = _values(rows, key)
        empty = "" if kind == "text" else None
        if key not in ("file", "outcome") and all(value == empty for value in values):
            continue
        entry: dict[str, Any] = {"key": key, "title": title, "kind": kind, "width": width, "hint": hint}
        if key in _NEVER:
            entry["zero"] = "never"
        distinct = list(dict.fromkeys(values))
        if 2 * len(distinct) < len(values):
            place = {value: k for k, value in enumerate(distinct)}
            entry |= {"words": distinct, "values": [place[value] for value in values]}
        else:
            entry["values"] = values
        columns.append(entry)
    fixed = sum(int(c["width"][:-2]) for c in columns if c["width"].endswith("px"))
    kinds = [rows.kind(i) for i in range(rows.n)]
    return {
        "n": rows.n, "kinds": kinds if len(set(kinds)) > 1 else [], "folder": common_folder(rows),
        "columns": columns, "wide": fixed + _ENDS + _FILE,
        "views": list(pictures.views), "pictures": list(pictures.thumbnails),
        "labels": sorted({readable(t) for t in rows.texts["label"]}),
    }  # fmt: skip


def common_folder(rows: ReportRows) -> str:
    """Give the folder all files are in, with its slash, which the page need not repeat; "" when there is none."""
    ends = rows.texts["file"].extent()
    if ends is None:
        return ""
    first, last = ends  # in order: what these share is what all share
    n = next((k for k, (a, b) in enumerate(zip(first, last, strict=False)) if a != b), len(first))
    return readable(first[: first.rfind("/", 0, n) + 1])


def shape_name(entry: dict[str, Any]) -> str:
    """Name an entry of the summary on one line."""
    name = readable(entry["file"])
    if "object" in entry:
        return f"{name} object {entry['object']}"
    return name if entry["cell"] is None else f"{name} cell {entry['cell']}"


def _values(rows: ReportRows, key: str) -> tuple[list[Any], str]:
    if key == "outcome":
        return list(rows.outcome), "text"
    if key == "reason":
        return [readable(rows.cause(i)) if rows.outcome[i] == "failed" else "" for i in range(rows.n)], "text"
    if key in rows.texts:
        tidy = one_line if key in _WHOLE else readable
        return [tidy(text) for text in rows.texts[key]], "text"
    if key in rows.lists:
        joined = [", ".join(_item(item) for item in items or [] if item is not None) for items in rows.lists[key]]
        return [one_line(text) for text in joined], "text"
    numbers = rows.numbers[key]
    if key in _TRUTHS:
        return [None if np.isnan(v) else bool(v) for v in numbers], "truth"
    return [_rounded(float(v)) for v in numbers], "number"


def _item(item: Any) -> str:
    return f"{item:.4g}" if isinstance(item, float) else str(item)


def _rounded(value: float) -> float | int | None:
    if not np.isfinite(value):
        return None
    if value == int(value) and abs(value) < 2**53:
        return int(value)
    short = float(f"{value:.{_DIGITS}g}")
    return value if short == int(short) else short  # what is not whole stays so: 1 means that all is seen


def _headline(summary: dict[str, Any]) -> str:
    """A sentence for each kind of row; what is said of one counts nothing of another."""
    if not summary["n_rows"]:
        return "The run has no rows yet."
    parts = [f"{count(summary['n_rows'])} rows from {count(summary['n_files'])} files."]
    kinds, objects = summary["kinds"], summary["objects"]
    stars, done = _stars(kinds.get("surface"))
    if done or list(kinds) == ["surface"]:
        parts.append(f"Some point sees the whole surface of {count(stars)} of the {count(done)} surfaces that could be "
                     f"evaluated ({percent(stars, done)}).")  # fmt: skip
    stars, done = _stars(kinds.get("cell"))
    if done:
        meshes = len(summary["volume_meshes"])
        parts.append(f"{count(stars)} of the {count(done)} cells of {count(meshes)} volume mesh{'es' * (meshes > 1)} "
                     f"are star-shaped ({percent(stars, done)}).")  # fmt: skip
    if objects:
        parts.append(f"{count(objects['n_star'])} of {count(objects['n'])} objects of label images are seen whole from "
                     f"one of their voxels ({percent(objects['n_star'], objects['n'])}).")  # fmt: skip
    return " ".join(parts)


def _stars(kind: dict[str, Any] | None) -> tuple[int, int]:
    """How many rows of a kind have a kernel, and how many could be evaluated."""
    if kind is None:
        return 0, 0
    counts = kind["counts"]
    return counts["star-shaped"] + counts["degenerate"], kind["n"] - counts["failed"]


def _main_kind(summary: dict[str, Any]) -> str:
    """The kind that the bar at the top is about: surfaces, if any could be evaluated."""
    kinds = summary["kinds"]
    if _stars(kinds.get("surface"))[1] or not kinds:
        return "surface"
    return next((kind for kind in kinds if _stars(kinds[kind])[1]), "surface")


def _main_counts(summary: dict[str, Any]) -> dict[str, int]:
    return summary["kinds"].get(_main_kind(summary), summary)["counts"]


def _bar_title(summary: dict[str, Any]) -> str:
    """Name what the bar counts, where there are several kinds."""
    if len(summary["kinds"]) < 2:
        return ""
    words = {"surface": "Surfaces", "cell": "Cells of volume meshes", "object": "Objects of label images"}
    return words[_main_kind(summary)]


def _matrix(summary: dict[str, Any], scores: Sequence[Score]) -> dict[str, Any] | None:
    """Rank correlations as a square table; None where fewer than two scores can be compared."""
    names = [s.name for s in scores if s.name in summary["scores"]]
    found = {(p["a"], p["b"]): p for p in summary["spearman"]}
    if len(names) < 2:
        return None
    rows = [[found.get((a, b)) or found.get((b, a)) for b in names] for a in names]
    return {"names": names, "rows": [[None if p is None else p["rho"] for p in row] for row in rows],
            "n": max(p["n"] for row in rows for p in row if p is not None)}  # fmt: skip


def _card(rows: ReportRows, pictures: Pictures, i: int, folder: str) -> dict[str, Any]:
    ratio, defect = rows.numbers["ratio"][i], rows.numbers["violation_upper"][i]
    words = [rows.outcome[i]]
    seen = rows.numbers["voxels_seen"][i]
    if np.isfinite(seen):
        words = [f"{percent(float(seen), 1.0)} seen", rows.texts["shortfall"][i] or "fine"]
    elif rows.outcome[i] == "star-shaped" and np.isfinite(ratio):
        words.append(f"ratio {number(float(ratio), 3)}")
    elif np.isfinite(defect) and defect > 0.0:
        words.append(f"defect {number(float(defect), 3)}")
        words.append("relaxed kernel in purple")
    return {
        "row": i, "name": readable(rows.name(i)).removeprefix(folder),
        "css": charts.CLASS_OF[rows.outcome[i]], "words": ", ".join(words),
        "has_picture": i in pictures.thumbnails,
    }  # fmt: skip


def _pictures_note(pictures: Pictures) -> str:
    parts: list[str] = []
    if pictures.thumbnails_left_out:
        parts.append(f"{count(pictures.thumbnails_left_out)} more thumbnails are in the run but not in this page, "
                     "to bound its size.")  # fmt: skip
    if pictures.unreadable:
        name, why = pictures.unreadable[0]
        parts.append(f"{count(len(pictures.unreadable))} pictures or views could not be read, the first: "
                     f"{readable(name)}: {one_line(why)}.")  # fmt: skip
    return " ".join(parts)


def _pretty(value: Any) -> str:
    return readable_lines(value if isinstance(value, str) else json_text(value, indent=1, ensure_ascii=False))


def _time(text: str) -> str:
    """Shorten an ISO time in UTC to minutes; other text stays."""
    match = re.match(r"(\d{4}-\d\d-\d\d)T(\d\d:\d\d)[\d:.]*(\+00:00|Z)$", text)
    return f"{match[1]} {match[2]} UTC" if match else readable(text)


def _pixels(value: float) -> str:
    return f"{value:.4g}"


def _shown_scores(entries: Sequence[dict[str, Any]]) -> list[str]:
    """Scores that any of these entries of the summary has."""
    return [s.name for s in ALL_SCORES if any(np.isfinite(entry.get(s.name, np.nan)) for entry in entries)]


def _score_title(name: str) -> str:
    return next(score.title.lower() for score in ALL_SCORES if score.name == name)


def readable_lines(text: str) -> str:
    """Keep line ends, escape what else cannot be printed."""
    return "\n".join(readable(line) for line in text.split("\n"))


def _hash(script: str) -> str:
    """Name a script in the page's content security policy: nothing else may run."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode('ascii')}'"
