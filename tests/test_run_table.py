"""The contract between evaluation and report: evaluation writes the columns of `run_table`, report reads no others."""

import ast
from pathlib import Path

import pyarrow as pa
import pytest

import voxkernel
from voxkernel import run_table
from voxkernel.report.page import _COLUMNS, _ON_REQUEST
from voxkernel.report.rows import CELL_SCORES, SCORES, from_table

PACKAGE = Path(voxkernel.__file__).parent


def test_types_are_what_the_table_says():
    schema = run_table.schema()
    assert schema.names == list(run_table.COLUMNS)
    assert schema.field("cell").type == pa.int64()
    assert schema.field("ratio").type == pa.float64()
    assert schema.field("notes").type == pa.list_(pa.string())


def test_a_column_stands_once_in_the_source():
    tree = ast.parse((PACKAGE / "run_table.py").read_text())
    (table,) = [n.value for n in tree.body if isinstance(n, ast.Assign) and n.targets[0].id == "COLUMNS"]
    names = [key.value for key in table.keys]
    assert len(names) == len(set(names)) == len(run_table.COLUMNS)


def test_a_row_with_another_column_is_refused():
    with pytest.raises(ValueError, match="`rows` must have columns of the table only; got ratios"):
        run_table.to_table([{"file": "a.ply", "ratios": 1.0}])


def subscripts():
    """Every `rows.texts["name"]` of the report, and what asks whether a column has numbers."""
    for file in sorted((PACKAGE / "report").glob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            is_text = isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant)
            if is_text and isinstance(node.value, ast.Attribute) and node.value.attr in ("texts", "numbers", "lists"):
                yield file.name, node.value.attr, node.slice.value


def test_the_report_reads_these_columns_only():
    empty = from_table(run_table.to_table([]))
    asked = list(subscripts())
    assert len(asked) > 20
    own = [("texts", "class")]  # what the report adds
    assert not [entry for entry in asked if entry[1:] not in own and entry[2] not in getattr(empty, entry[1])]
    assert {score.column for score in (*SCORES, *CELL_SCORES)} <= set(empty.numbers)
    assert {key for key, *_ in _COLUMNS} - {"outcome", *_ON_REQUEST} <= {*empty.texts, *empty.numbers, *empty.lists}
