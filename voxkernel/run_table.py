"""The contract between evaluation and report: every column of a run's table, and the run on any fsspec file system."""

from __future__ import annotations

import json
import os
import posixpath
import re
import time
import uuid
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from operator import itemgetter
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel._input_file import check_stored_file
from voxkernel._output_file import is_unfinished, whole_file
from voxkernel._plain import json_text

__all__ = [
    "COLUMNS", "Part", "csv_line", "current_rows", "defused", "extra_of", "is_local", "open_part", "open_run",
    "part_names", "read_part", "read_parts", "read_rows", "read_settings", "remove_parts", "remove_unfinished",
    "schema", "to_table", "told", "while_parts_move", "without_marks", "write_bytes", "write_csv",
    "write_part", "write_settings", "write_table_part",
]  # fmt: skip

T = TypeVar("T")
_COMPARED = 1 << 16  # names of files that are copied at a time
_BATCH = 1 << 14  # rows that are read at a time where few of them are wanted

# Every column, once, in the order of the table: its name and its type in Arrow's words. What a row does not have is
# null. A row is a surface, a cell of a polyhedral mesh, or an object of a label image, as `kind` says: "surface",
# "cell" or "label" (null in runs of earlier versions and where a file failed). `cell` is null but for a cell, `object`
# (its number in the image) but for an object; the star centre is where the violation is smallest, the centre where the
# kernel is deepest. Lengths are in mesh units, shares of the area or of a volume in [0, 1].
COLUMNS = {
    # which shape, and what came of it
    "file": "string", "kind": "string", "cell": "int64", "object": "int64", "label": "string", "status": "string",
    "reason": "string",
    # the kernel
    "verdict": "string", "verdict_reason": "string", "dimension": "int64", "ratio": "double", "volume": "double",
    "volume_lower": "double", "volume_upper": "double", "reference": "string", "reference_volume": "double",
    "clearance": "double", "domain": "string", "cut_by_domain": "bool",
    "center_x": "double", "center_y": "double", "center_z": "double",
    # the best point where there is no kernel
    "violation_lower": "double", "violation_upper": "double",
    "star_center_x": "double", "star_center_y": "double", "star_center_z": "double",
    "profile_tolerances": "list<double>", "profile_shares": "list<double>",
    "visible_fraction": "double", "visible_lower": "double", "visible_upper": "double", "energies": "list<double>",
    # few points that see a share of the area
    "guards": "int64", "guards_seen": "double", "guards_certified": "double", "guards_reason": "string",
    # of cells only
    "inradius": "double", "volume_share": "double", "inradius_over_diameter": "double",
    # of objects of a label image only; positions and spacing in the order of its axes
    "n_objects": "int64", "voxels": "int64", "spacing": "list<double>", "box_low": "list<int64>",
    "box_high": "list<int64>", "n_fragments": "int64", "n_holes": "int64", "hole_voxels": "int64",
    "touches_border": "bool", "elongation": "double", "voxels_seen": "double", "voxels_seen_upper": "double",
    "center_index": "list<int64>", "center_world": "list<double>", "seen_deepest": "double", "seen_centroid": "double",
    "n_rays": "list<int64>", "iou": "list<double>", "iou_stepped": "list<double>", "overlap": "double",
    "rays_for_80": "int64", "rays_for_90": "int64", "shortfall": "string", "shortfall_detail": "string",
    "causes": "list<string>",
    # the proof
    "certificate_kind": "string", "certificate_facets": "list<int64>", "certificate_verified": "bool",
    "notes": "list<string>",
    # the surface
    "n_vertices": "int64", "n_faces": "int64", "n_facets": "int64", "n_components": "int64",
    "n_boundary_edges": "int64", "n_nonmanifold_edges": "int64", "n_degenerate": "int64", "genus": "int64",
    "is_closed": "bool", "is_oriented": "bool", "is_outward": "bool",
    "area": "double", "enclosed_volume": "double", "diagonal": "double",
    # pictures, times, and what makes a row the same row
    "thumbnail": "string", "view": "string",
    "seconds": "double", "seconds_read": "double", "seconds_exact": "double", "seconds_relaxed": "double",
    "seconds_pictures": "double", "finished": "string",
    "file_size": "int64", "file_modified_ns": "int64", "file_changed_ns": "int64", "file_inode": "int64",
    "content_hash": "string", "settings_hash": "string", "settings": "string", "versions": "string",
}  # fmt: skip

# What makes a spreadsheet take a cell for a formula, also behind apostrophes, so that each text has its own cell.
_FORMULA = re.compile("'*[=+\\-@\t\r\n\0＝＋－＠]")


def schema() -> Any:
    """Give the Arrow schema of the table."""
    pa = optional("pyarrow")

    def kind(name: str) -> Any:
        inner = name.removeprefix("list<").removesuffix(">")
        return pa.type_for_alias(name) if inner == name else pa.list_(pa.type_for_alias(inner))

    return pa.schema([pa.field(name, kind(words)) for name, words in COLUMNS.items()])


def to_table(rows: Sequence[Mapping[str, Any]]) -> Any:
    """Make a table of rows; what a row does not have is null, and nothing but a column may be in it."""
    pa = optional("pyarrow")
    if unknown := {name for row in rows for name in row} - set(COLUMNS):
        raise ValueError(f"`rows` must have columns of the table only; got {', '.join(sorted(unknown))}")
    return pa.Table.from_pylist([dict(row) for row in rows], schema=schema())


def open_run(run: str) -> tuple[Any, str]:
    """Give the file system of a run directory or URL and its path there."""
    fsspec = optional("fsspec")
    try:
        fs, path = fsspec.core.url_to_fs(run)
    except ImportError as error:
        raise ValueError(f"'{run}' cannot be opened: {error}{extra_of(run)}") from error
    path = str(path).rstrip("/") or "/"
    if not is_local(fs):
        with told(run):
            fs.exists(path)
    return fs, path


@contextmanager
def told(url: str) -> Generator[None]:
    """Say in one line why a store does not answer, whose errors are of its own kinds: no key, no network, no right."""
    try:
        yield
    except Exception as error:
        raise ValueError(f"'{url}' cannot be opened: {' '.join(str(error).split()) or type(error).__name__}") from error


def extra_of(url: str) -> str:
    """Say which extra brings the file system of a URL."""
    return '; the extra `s3` brings it: `pip install "voxkernel[s3]"`' if url.startswith("s3://") else ""


def write_bytes(fs: Any, path: str, data: bytes) -> None:
    """Write a file that is there completely or not at all."""
    fs.makedirs(posixpath.dirname(path), exist_ok=True)
    if not is_local(fs):
        fs.pipe_file(path, data)  # one put: the object appears when it is complete
        return
    with whole_file(path, durable=True) as stream:
        stream.write(data)


def write_part(fs: Any, run_path: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Write rows as a new part of a run, atomically; returns the path of the part."""
    return write_table_part(fs, run_path, to_table(rows))


def write_table_part(fs: Any, run_path: str, table: Any, *, after: str = "", like: str = "") -> str:
    """Write a table as a new part.

    Its name sorts behind that of the part `after` even if the clock was set back, or is of the age of the part `like`.
    """
    pa, pq = optional("pyarrow"), optional("pyarrow.parquet")
    found = re.match(r"part-(\d+)-", posixpath.basename(after))
    stamp = f"{max(time.time_ns(), int(found[1]) + 1 if found else 0):020d}"
    if like:
        stamp = posixpath.basename(like).removeprefix("part-").removesuffix(".parquet").partition("-")[0]
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    path = posixpath.join(run_path, "rows", f"part-{stamp}-{uuid.uuid4().hex[:8]}.parquet")
    write_bytes(fs, path, sink.getvalue().to_pybytes())
    return path


def part_names(fs: Any, run_path: str) -> list[str]:
    """List the parts of a run, oldest first."""
    folder = posixpath.join(run_path, "rows")
    fs.invalidate_cache()
    if not fs.exists(folder):
        return []
    names = [str(name) for name in fs.ls(folder, detail=False)]
    return sorted(n for n in names if posixpath.basename(n).startswith("part-") and n.endswith(".parquet"))


def read_parts(fs: Any, names: Iterable[str]) -> Any:
    """Read parts into one table: the latest row of each key, sorted by file, cell and object.

    A later part counts, whatever it says; a file computed again replaces all its earlier rows. The rows of one
    computation share the time it finished.
    """
    pa = optional("pyarrow")
    tables: list[Any] = []
    for name in names:
        part = open_part(fs, name)
        tables.append(read_part(part))
        part.close()
    whole = pa.concat_tables([schema().empty_table(), *tables])
    return whole.take(pa.array(current_rows(whole)))


def current_rows(table: Any) -> NDArray[np.int64]:
    """Find the rows that count of parts behind each other, oldest first: sorted by file, cell and object."""
    pa, compute = optional("pyarrow"), optional("pyarrow.compute")
    order, is_new = _by_file(table.column("file"))
    if is_new.all():
        return order
    files = np.empty(len(order), np.int64)
    files[order] = np.cumsum(is_new) - 1
    again = np.flatnonzero(np.bincount(files)[files] > 1)  # only what is there twice can have been replaced
    last = np.zeros(len(order), np.int64)
    np.maximum.at(last, files, np.arange(len(order)))
    counts = np.ones(len(order), bool)
    for name in ("content_hash", "settings_hash", "finished"):
        own = table.column(name).take(pa.array(again))
        newest = table.column(name).take(pa.array(last[files[again]]))
        same = compute.or_(compute.equal(own, newest).fill_null(False), compute.and_(own.is_null(), newest.is_null()))
        counts[again] &= np.asarray(same.to_numpy(), bool)
    rows = np.flatnonzero(counts)
    cell, number = (table.column(name).fill_null(-1).to_numpy()[rows] for name in ("cell", "object"))
    order = np.lexsort((rows, number, cell, files[rows]))
    key = np.stack([files[rows], cell, number])[:, order]
    is_last = np.append((key[:, 1:] != key[:, :-1]).any(axis=0), True)[: len(rows)]
    return rows[order[is_last]].astype(np.int64)


def _by_file(column: Any) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Order rows by their file, equal ones as they come, and say which is the first of its file."""
    pa, compute = optional("pyarrow"), optional("pyarrow.compute")
    order = compute.sort_indices(column).to_numpy().astype(np.int64)
    is_new = np.ones(len(order), bool)
    for k in range(1, len(order), _COMPARED):
        own = column.take(pa.array(order[k - 1 : k + _COMPARED]))
        is_new[k : k + _COMPARED] = compute.not_equal(own[1:], own[:-1]).to_numpy()
    return order, is_new


@dataclass(frozen=True, slots=True)
class Part:
    """An open part of a run."""

    name: str
    file: Any

    @property
    def num_rows(self) -> int:
        """How many rows it holds, whether they count or not."""
        return int(self.file.metadata.num_rows)

    def close(self) -> None:
        """Let go of its file."""
        self.file.close(force=True)


def open_part(fs: Any, name: str) -> Part:
    """Open a part; one on this machine stays readable when it is deleted."""
    pa, pq = optional("pyarrow"), optional("pyarrow.parquet")
    check_stored_file(fs, name)
    with _damage_named(name):
        source = pa.OSFile(os.fsencode(name)) if is_local(fs) else pa.BufferReader(fs.cat_file(name))
        part = Part(name, pq.ParquetFile(source))
        column, times = max(Counter(part.file.schema_arrow.names).items(), key=itemgetter(1), default=("", 0))
        if times > 1:
            part.close()
            raise ValueError(f"{times} columns named '{column}'")
        return part


def read_part(part: Part, columns: Sequence[str] | None = None) -> Any:
    """Read a part, or columns of it; those that an older version has not written are null."""
    pa = optional("pyarrow")
    wanted = schema() if columns is None else pa.schema([schema().field(name) for name in columns])
    present = set(part.file.schema_arrow.names)
    with _damage_named(part.name):
        table = part.file.read(columns=[name for name in wanted.names if name in present])
        return _checked(table, wanted, part.num_rows)


def read_batches(part: Part) -> Iterator[Any]:
    """Read a part as tables of some thousand rows, as `read_part` does."""
    pa = optional("pyarrow")
    wanted = schema()
    present = set(part.file.schema_arrow.names)
    with _damage_named(part.name):
        for batch in part.file.iter_batches(_BATCH, columns=[name for name in wanted.names if name in present]):
            yield _checked(pa.Table.from_batches([batch]), wanted, batch.num_rows)


def _checked(table: Any, wanted: Any, n: int) -> Any:
    """Give a table the columns that are wanted; those that are missing are null."""
    pa = optional("pyarrow")
    table.validate(full=True)
    present = set(table.column_names)
    found = [table.column(f.name).cast(f.type) if f.name in present else pa.nulls(n, f.type) for f in wanted]
    unnamed = found[wanted.get_field_index("file")].null_count if "file" in wanted.names else 0
    if unnamed:
        raise ValueError(f"{unnamed} rows that name no file")
    return pa.Table.from_arrays(found, schema=wanted)


@contextmanager
def _damage_named(name: str) -> Generator[None]:
    pa = optional("pyarrow")
    try:
        yield
    except FileNotFoundError:
        raise
    except (pa.ArrowException, OSError, ValueError, MemoryError, RecursionError) as error:
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise ValueError(f"'{name}' must be a part of a run; got {reason}") from error


def read_rows(run: str) -> Any:
    """Read the table of a run directory or URL.

    Returns
    -------
    pyarrow.Table
        Columns of `schema`; the latest row per file, cell and object, sorted by them.
    """
    fs, path = open_run(run)
    return without_marks(while_parts_move(lambda: read_parts(fs, part_names(fs, path))))


def without_marks(table: Any) -> Any:
    """Leave out rows that only say that a label image holds no objects, so that it is not read again."""
    compute = optional("pyarrow.compute")
    return table.filter(compute.not_equal(table.column("n_objects").fill_null(-1), 0))


def while_parts_move(read: Callable[[], T]) -> T:
    """Read parts, again where a run that goes on has just made one part of several."""
    for _ in range(10):
        try:
            return read()
        except FileNotFoundError:
            time.sleep(0.05)
    return read()


def remove_parts(fs: Any, names: Iterable[str]) -> None:
    """Delete parts whose rows are in a later one."""
    for name in names:
        fs.rm_file(name)


def remove_unfinished(run_path: str) -> None:
    """Delete what `write_bytes` left in a local run when its process was killed; only for who holds the run's lock."""
    for folder in ("", "rows", "thumbnails", "views"):
        place = os.path.join(run_path, folder)
        for name in os.listdir(place) if os.path.isdir(place) else ():
            if is_unfinished(name):
                os.unlink(os.path.join(place, name))


def write_settings(fs: Any, run_path: str, settings: Mapping[str, Any]) -> None:
    """Write `settings.json` of a run."""
    text = json_text(settings, indent=1, sort_keys=True) + "\n"
    write_bytes(fs, posixpath.join(run_path, "settings.json"), text.encode())


def read_settings(run: str) -> dict[str, Any]:
    """Read `settings.json` of a run; empty where there is none."""
    fs, path = open_run(run)
    name = posixpath.join(path, "settings.json")
    check_stored_file(fs, name)
    if not fs.exists(name):
        return {}
    try:
        found = json.loads(fs.cat_file(name))
    except (ValueError, RecursionError) as error:
        raise ValueError(f"'{name}' must be the settings of a run; got {type(error).__name__}: {error}") from error
    if not isinstance(found, dict):
        raise ValueError(f"'{name}' must be the settings of a run; got {type(found).__name__}")
    return found


def write_csv(fs: Any, run_path: str, tables: Iterable[Any]) -> str:
    """Write tables behind each other as `rows.csv`; lists become JSON text, and texts are `defused`."""
    path = posixpath.join(run_path, "rows.csv")
    fs.makedirs(run_path, exist_ok=True)
    with whole_file(path, durable=True) if is_local(fs) else fs.open(path, "wb") as stream:
        stream.write(csv_line(list(COLUMNS)).encode())
        for table in tables:
            for batch in table.to_batches(max_chunksize=1000):
                lines = "".join(csv_line(list(row.values())) for row in batch.to_pylist())
                stream.write(lines.encode("utf-8", "surrogateescape"))
    return path


def defused(text: str) -> str:
    """Put an apostrophe before a text that a spreadsheet would run as a formula.

    A text that begins with apostrophes and then such a character gets one more, so that taking one away from what
    looks like this always gives the text back.
    """
    return "'" + text if _FORMULA.match(text) else text


def csv_line(values: Sequence[Any]) -> str:
    """Write one line of a CSV file: texts `defused`, lists as JSON.

    A carriage return within a text is quoted, as only a writer that ends lines with one does; unquoted it would begin
    a line of its own, with a cell that may be a formula.
    """
    import csv
    import io

    cells = [defused(v) if isinstance(v, str) else json_text(v) if isinstance(v, list) else v for v in values]
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\r\n").writerow(cells)
    return text.getvalue().removesuffix("\r\n") + "\n"


def is_local(fs: Any) -> bool:
    """Whether a file system is that of this machine."""
    protocol = fs.protocol
    return "file" in ((protocol,) if isinstance(protocol, str) else protocol)
