"""Runs of `evaluate` for the fuzzing: their tables, pictures and labels."""

import io
import json
import shutil
import struct
import zipfile
import zlib
from functools import cache

import fuzz_mutations as fm
import numpy as np
import report_runs
from fuzz_grids import damage_member


def _report(run, data):
    """A report of one kind, chosen by the content; the page is rare, for it takes fifty times as long."""
    from voxkernel import write_report

    chance = zlib.crc32(data) % 100
    path = run / ("report.html" if chance == 0 else "report.md" if chance < 30 else "report.json")
    write_report(path, run)
    text = path.read_bytes().decode("utf-8")
    if path.suffix == ".json":
        json.loads(text)
    return ()


def _fresh_run(path):
    run = path.parent / "run"
    shutil.rmtree(run, ignore_errors=True)
    (run / "rows").mkdir(parents=True)
    return run


def _with_part(path, data):
    run = _fresh_run(path)
    (run / "rows" / "part-00000000000000000001-00000000.parquet").write_bytes(data)
    return run


def read_report_parquet(path):
    data = path.read_bytes()
    return _report(_with_part(path, data), data)


def read_report_rows(path):
    """Rows of damaged values, as far as the table can hold them."""
    import pyarrow as pa

    from voxkernel.run_table import to_table

    data = path.read_bytes()
    rows = json.loads(data.decode("utf-8", "surrogatepass"))
    table = _table_of(rows)
    if table is None:
        tables = [_table_of([row]) for row in rows]
        table = pa.concat_tables([to_table([]), *(one for one in tables if one is not None)])
    return _report(_with_part(path, _parquet(table)), data)


def _table_of(rows):
    import pyarrow as pa

    from voxkernel.run_table import to_table

    try:
        return to_table(rows)
    except (pa.ArrowException, TypeError, OverflowError, UnicodeError, ValueError):
        return None


def read_report_view(path):
    """A damaged picture costs its picture, never the report."""
    from voxkernel.report.pictures import collect
    from voxkernel.report.rows import from_table
    from voxkernel.run_table import to_table

    data = path.read_bytes()
    run = _fresh_run(path)
    kind = "view" if data[:1] == b"P" else "thumbnail"
    (run / "views").mkdir()
    (run / "views" / "a").write_bytes(data)
    row = report_runs.surface_row("a.ply", np.random.default_rng(1), **{kind: "views/a"})
    try:
        collect(str(run), from_table(to_table([row])), n_views=1, max_bytes=10**7)
    except ValueError as error:
        raise AssertionError(f"a picture cost the report: {error}") from error
    return ()


def read_labels_csv(path):
    from voxkernel.evaluation.inputs import read_labels

    labels = read_labels(str(path))
    for name, label in labels.table.items():
        assert isinstance(name, str), "a file that is no text"
        assert isinstance(label, str), "a label that is no text"
    labels.of("shapes/cube.ply")
    return (np.array(sorted(labels.table.items())),)


def run_rows():
    rng = np.random.default_rng(7)
    rows = [
        report_runs.surface_row("convex/a.ply", rng, "convex"),
        report_runs.surface_row("star/b.ply", rng, "star", "not star-shaped"),
        report_runs.surface_row("c.ply", rng, "", "degenerate"),
        report_runs.failed_row("d.ply", label="star"),
        report_runs.cell_row("e.hedra", 1, rng),
    ]
    return [{name: _plain_value(value) for name, value in row.items()} for row in rows]


def _plain_value(value):
    return value.item() if isinstance(value, np.generic) else value


def rows_seeds():
    return [json.dumps(run_rows()).encode()]


def damage_rows(rng, data):
    rows = json.loads(data)
    if rng.random() < 0.4:  # JSON inside a text column
        row, name = rng.choice(rows), rng.choice(("settings", "versions"))
        text = fm.damage_json_text(rng, str(row.get(name, "{}")).encode())
        if rng.random() < 0.3:
            depth = rng.choice((100, 900, 1500, 20000))
            text = rng.choice((b"[" * depth + b"]" * depth, b'{"a":' * depth + b"1" + b"}" * depth))
        row[name] = text.decode("utf-8", "replace")
        return json.dumps(rows).encode()
    return json.dumps(fm.damage_json(rng, rows)).encode("utf-8", "surrogatepass")


def _parquet(table, codec="zstd"):
    import pyarrow as pa
    import pyarrow.parquet as pq

    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression=codec)
    return sink.getvalue().to_pybytes()


@cache
def parquet_seeds():
    from voxkernel.run_table import to_table

    return [_parquet(to_table(run_rows()), codec) for codec in ("zstd", "none", "snappy")]


def damage_parquet(rng, data):
    """The footer tells where everything is: half of the damage goes there, its length among it."""
    if rng.random() < 0.2:
        return _other_table(rng, data)
    n = int.from_bytes(data[-8:-4], "little")
    if rng.random() < 0.5:
        start = len(data) - 8 - n
        footer = fm.damage_bytes(rng, data[start:-8])
        size = len(footer) if rng.random() < 0.8 else rng.choice(fm.NASTY_NUMBERS) % 2**32
        return data[:start] + footer + struct.pack("<I", size) + data[-4:]
    return fm.damage_bytes(rng, data, [(len(data) - 8, 4), (0, 4), (len(data) - 4, 4)])


def _other_table(rng, data):
    """A sound Parquet file of other columns: missing, of another type, or twice."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    table = pq.read_table(pa.BufferReader(data))
    for _ in range(rng.choice((1, 2))):
        at = rng.randrange(table.num_columns)
        name = table.column_names[at]
        kind = rng.randrange(4)
        kinds = (pa.string(), pa.int64(), pa.float64(), pa.bool_(), pa.list_(pa.int64()), pa.binary(), pa.date32())
        if kind == 0:
            table = table.remove_column(at)
        elif kind == 1:
            table = table.set_column(at, name, pa.nulls(len(table), rng.choice(kinds)))
        elif kind == 2:
            values = [fm.nasty_value(rng) for _ in range(len(table))]
            try:
                table = table.set_column(at, name, pa.array(values, rng.choice(kinds)))
            except (pa.ArrowException, TypeError, OverflowError, UnicodeError, ValueError):
                continue
        else:
            table = table.append_column(rng.choice(table.column_names), table.column(at))
    return _parquet(table)


@cache
def view_seeds():
    vertices, faces = report_runs.octahedron()
    inner, inner_faces = report_runs.octahedron(0.3)
    stream = io.BytesIO()
    np.savez(stream, vertices=vertices, faces=faces, kernel_vertices=inner, kernel_faces=inner_faces)
    members = fm.zip_members(stream.getvalue())
    return [fm.zip_bytes(members, zipfile.ZIP_STORED), fm.zip_bytes(members), report_runs.png(8, 6)]


def damage_view(rng, data):
    return fm.damage_zip(rng, data, damage_member) if data[:2] == b"PK" else fm.damage_bytes(rng, data)


def labels_seeds():
    return [b"file,label\ncube.ply,star\nshapes/l.off,not star\n", b'\xef\xbb\xbflabel,file,more\r\n"a, b",x.ply,1\r\n']


def damage_csv(rng, data):
    return fm.damage_text(rng, data, ("file", "label", '"', ",", "\0"), ('"', ",", "\n"))
