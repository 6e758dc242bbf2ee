"""Reports of a run: an offline HTML page, Markdown for a pull request, JSON for programs, LaTeX for a paper."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_path
from voxkernel._output_file import whole_file
from voxkernel._plain import json_text, plain
from voxkernel.report.large_run import MOST_ROWS, rows_to_show, write_whole_table
from voxkernel.report.rows import ReportRows, from_index, from_table, open_run_index
from voxkernel.run_index import RunIndex

__all__ = ["write_report"]

Format = Literal["html", "markdown", "json", "latex"]
_SUFFIXES: dict[str, Format] = {
    ".html": "html", ".htm": "html", ".md": "markdown", ".json": "json", ".tex": "latex",
}  # fmt: skip


def write_report(
    path: str | os.PathLike[str],
    run: str | os.PathLike[str],
    *,
    format: Literal["html", "markdown", "json", "latex"] | None = None,
    title: str | None = None,
    star_labels: Sequence[str] | None = None,
    classes: Sequence[str] | None = None,
    compare: str | os.PathLike[str] | None = None,
    n_views: int = 12,
    n_worst: int = 10,
    max_megabytes: float = 40.0,
) -> dict[str, Any]:
    """Write the report of an evaluation.

    Parameters
    ----------
    path : str or os.PathLike
        File to write.
    run : str or os.PathLike
        Folder or URL that `evaluate` wrote. Its table is read, the thumbnails and views the table names, and which
        files were left out, from `settings.json`; never a mesh.
    format : {"html", "markdown", "json", "latex"}, optional
        By default from the suffix of `path`: .html, .md, .json or .tex. LaTeX is tables for the package booktabs, and
        beside them each figure as ``.pdf`` and ``.svg``, drawn by Matplotlib.
    title : str, optional
        Words above the report; the name of the run by default.
    star_labels : sequence of str, optional
        Labels that mean star-shaped; all others then mean that it is not. By default labels such as "star" and
        "not star-shaped" are understood when there are no others.
    classes : sequence of str, optional
        Classes by thresholds, such as "nearly star-shaped: defect<0.01"; a row belongs to the first whose comparisons
        (of scores or columns of numbers, all must hold) are true. They are counted, against the labels too.
    compare : str or os.PathLike, optional
        Another run, usually an earlier one, that this one is held against: changed verdicts, regressions, how far
        scores moved.
    n_views : int
        How many shapes the page lets a reader turn in 3D, at most; those the run has views of.
    n_worst : int
        Rows in the list of the least star-shaped (Markdown and JSON).
    max_megabytes : float
        Bound on the pictures and views inside the page, megabytes as embedded; the rest is left out and counted.

    Returns
    -------
    dict
        The summary, as the JSON report has it.

    Raises
    ------
    ValueError
        If the format is unknown, a count is negative, a star label is not in the run, a class cannot be read, or its
        table or `settings.json` is damaged.
    FileNotFoundError
        If there is no run, or no folder for the report.
    OSError
        If the report cannot be written.

    Notes
    -----
    The numbers of a page are those of all rows. Its table shows 20,000 at most, failed and worst ones first, then
    others evenly; where a run has more, all are written beside the page, as ``report.rows.parquet`` for
    ``report.html``. Rows are read a column or a part of the run at a time.

    The page needs no network: styles, scripts and pictures are in it, and its content security policy allows
    nothing else to load or run. File names, labels and reasons are shown as text, whatever they contain;
    characters that cannot be printed are shown as escapes.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from voxkernel.run_table import open_run, write_part
    >>> row = {"file": "cube.ply", "status": "ok", "verdict": "star-shaped", "ratio": 1.0}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = write_part(*open_run(folder), [row])
    ...     summary = write_report(pathlib.Path(folder) / "report.html", folder)
    >>> summary["counts"]["star-shaped"]
    1
    """
    target = as_path("path", path)
    kind = _format_of(target, format)
    for name, value in (("n_views", n_views), ("n_worst", n_worst), ("max_megabytes", max_megabytes)):
        if not value >= 0:
            raise ValueError(f"`{name}` must be 0 or more; got {value}")
    if not target.absolute().parent.is_dir():
        raise FileNotFoundError(f"`path` must be in an existing folder; got '{target}'")
    where = os.fspath(run)
    heading = title if title is not None else _name_of(where)
    options = (where, heading, star_labels, classes, compare, n_views, n_worst, int(max_megabytes * 1e6))
    with closing(open_run_index(where)) as index:
        if kind != "html" or len(index) <= MOST_ROWS:
            return _written(target, kind, index, None, *options)
        beside = write_whole_table(target, index)  # while no column is in memory
        try:
            return _written(target, kind, index, beside, *options)
        except BaseException:
            beside.unlink()
            raise


def _written(
    target: Path, kind: Format, index: RunIndex, beside: Path | None, where: str, heading: str,
    star_labels: Sequence[str] | None, classes: Sequence[str] | None, compare: str | os.PathLike[str] | None,
    n_views: int, n_worst: int, max_bytes: int,
) -> dict[str, Any]:  # fmt: skip
    from voxkernel.report.summary import read_left_out, summarize

    rows = from_index(index)
    left_out = read_left_out(where)
    rows, more = _extended(rows, where, classes, compare)
    summary = summarize(rows, run=where, left_out=left_out, n_worst=n_worst, star_labels=star_labels) | more
    if kind == "json":
        text = json_text({"title": heading, **_document(summary)}, indent=1) + "\n"
    elif kind == "markdown":
        from voxkernel.report.markdown import render_markdown

        text = render_markdown(summary, title=heading)
    elif kind == "latex":
        from voxkernel.report.figures import write_figures
        from voxkernel.report.latex import render_latex

        figures = write_figures(target, rows, summary)
        text = render_latex(summary, title=heading, figures=figures)
    else:
        shown = rows
        if beside is not None:
            ids = rows_to_show(rows, MOST_ROWS)
            rows.forget()
            shown = _part(rows, index, ids)
        name = "" if beside is None else beside.name
        text = _page(rows, shown, name, summary, where, heading, star_labels, n_views, max_bytes)
    with whole_file(target) as stream:
        stream.write(text.encode("utf-8", "backslashreplace"))  # stray bytes of names become escapes
    return _document(summary)


def _part(rows: ReportRows, index: RunIndex, ids: NDArray[np.int64]) -> ReportRows:
    """Read some rows at once, with the columns that classes and another run bring."""
    part = from_table(index.rows(ids))
    texts = {name: rows.texts[name].taken(ids) for name in rows.texts if name not in part.texts}
    numbers = {name: rows.numbers[name][ids] for name in rows.numbers if name not in part.numbers}
    return part.with_columns(texts, numbers)


def _extended(
    rows: ReportRows, run: str, classes: Sequence[str] | None, compare: str | os.PathLike[str] | None
) -> tuple[ReportRows, dict[str, Any]]:
    """Rows with the columns, and the parts of the summary, that classes and another run bring."""
    more: dict[str, Any] = {"classes": None, "comparison": None}
    if classes is not None:
        from voxkernel.report.classes import class_rules, class_summary, with_classes

        rules = class_rules(classes)
        rows = with_classes(rows, rules)
        more["classes"] = class_summary(rows, rules)
    if compare is not None:
        from voxkernel.report.compare import comparison, comparison_charts, matched, with_changes

        other = os.fspath(compare)
        names = _name_of(run), _name_of(other)
        if names[0] == names[1]:
            names = run, other
        with closing(open_run_index(other)) as index:
            before = from_index(index)
            pairs, matched_by = matched(rows, before)
            more["comparison"] = comparison(rows, before, pairs, matched_by=matched_by, names=names)
            more["comparison"]["charts"] = comparison_charts(rows, before, pairs)
            rows.forget()
            rows = with_changes(rows, before, pairs)
            before.forget()
    return rows, more


def _page(
    rows: ReportRows, shown: ReportRows, beside: str, summary: dict[str, Any], run: str, title: str,
    star_labels: Sequence[str] | None, n_views: int, max_bytes: int,
) -> str:  # fmt: skip
    from voxkernel.report.labels import star_truth, wrong_ids
    from voxkernel.report.objects import worst_objects
    from voxkernel.report.page import render_page
    from voxkernel.report.pictures import collect

    wrong = wrong_ids(shown, star_truth(rows, star_labels))
    first = [*worst_objects(shown, 24), *wrong[: n_views // 3]]
    pictures = collect(run, shown, n_views=n_views, max_bytes=max_bytes, first=first)
    return render_page(
        rows, summary, pictures, title=title, chosen=list(pictures.views), shown=shown, beside=beside
    )


def _format_of(target: Path, format: str | None) -> Format:
    if format is None:
        if target.suffix.lower() not in _SUFFIXES:
            raise ValueError(f"`path` must end in .html, .md, .json or .tex, or `format` be given; got '{target.name}'")
        return _SUFFIXES[target.suffix.lower()]
    if format not in get_args(Format):
        raise ValueError(f"`format` must be one of {', '.join(get_args(Format))}; got '{format}'")
    return format  # type: ignore[return-value]


def _document(summary: dict[str, Any]) -> dict[str, Any]:
    """Leave the points of curves and the charts out: they are for the drawing."""
    if summary["comparison"] is not None:
        own = {name: value for name, value in summary["comparison"].items() if name != "charts"}
        summary = {**summary, "comparison": own}
    labels = summary["labels"]
    if labels is not None:
        roc = [
            {**entry, "scores": {name: {k: v for k, v in found.items() if k != "curve"}
                                 for name, found in entry["scores"].items()}}
            for entry in labels["roc"]
        ]  # fmt: skip
        summary = {**summary, "labels": {**labels, "roc": roc}}
    return plain(summary)


def _name_of(run: str) -> str:
    """Name a run by its last folder."""
    parts = [part for part in run.replace("\\", "/").split("/") if part not in ("", ".", "..")]
    return parts[-1] if parts else Path(run).absolute().name
