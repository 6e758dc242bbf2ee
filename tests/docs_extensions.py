"""Modules of the documentation's own extensions, for the tests of what they make."""

import importlib
import sys
from contextlib import contextmanager
from pathlib import Path

DOCS = Path(__file__).resolve().parent.parent / "docs"


@contextmanager
def extension(name):
    """The module, importable while it is used."""
    sys.path.insert(0, str(DOCS / "_ext"))
    try:
        yield importlib.import_module(name)
    finally:
        sys.path.remove(str(DOCS / "_ext"))
