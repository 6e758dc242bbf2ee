"""Random damage to .vdb and .npz files: an answer or `GridReadError`, in bounded time and memory.

Run with ``pytest -m slow tests/vdb/test_vdb_fuzz.py``; VOXKERNEL_FUZZ_INPUTS sets the number of inputs per test (5000).
"""

import dataclasses
import os
import struct
import time
import tracemalloc
import warnings

import numpy as np
import pytest
from grids import random_frame, random_grid, with_inactive_tiles
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from voxkernel.errors import GridReadError
from voxkernel.grid import SparseGrid, read_npz, write_npz
from voxkernel.vdb import write_vdb
from voxkernel.vdb.file_format import Source
from voxkernel.vdb.vdb_file import _read

N_INPUTS = int(os.environ.get("VOXKERNEL_FUZZ_INPUTS", "5000"))
SECONDS = 5.0  # of processor time
pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def only_when_asked(request):
    if "slow" not in (request.config.option.markexpr or ""):
        pytest.skip("fuzzing; run with -m slow")


@pytest.fixture(scope="module")
def samples(tmp_path_factory):
    """Small valid files of every kind."""
    path = tmp_path_factory.mktemp("fuzz") / "a.vdb"
    mask = dataclasses.replace(
        random_grid(1, n_cells=6), **random_frame(2), name="mask", metadata={"a": 1, "v": (1, 2, 3)}
    )
    field = with_inactive_tiles(random_grid(2, has_values=True, n_cells=5, background=0.5), 3)
    root_tiles = SparseGrid.from_tiles_and_leaves([[0, 0, 0], [-4096, 0, 0]], [12, 12], [], [])
    found = []
    for grids, options in (
        (mask, {}),
        (mask, {"value_type": "mask"}),
        (field, {}),
        (field, {"compression": "zip"}),
        (field, {"compression": "blosc"}),
        (field, {"value_type": "half", "compression": "zip"}),
        ([mask, field, root_tiles], {}),
        ([], {}),
    ):
        write_vdb(path, grids, metadata={"author": "fuzz"}, **options)
        found.append(path.read_bytes())
    return found


NASTY = [0, 1, 7, 8, 255, 2**15, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1, 2**63, 2**64 - 1]


@st.composite
def damage(draw):
    """A list of edits, each a function of the bytes."""
    edits = []
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from(["byte", "number", "cut", "remove", "repeat", "noise"]))
        # near the start of the file the fields that steer the reader are dense
        place = draw(st.one_of(st.floats(0, 1), st.floats(0, 0.02)))
        value = draw(st.one_of(st.sampled_from(NASTY), st.integers(0, 2**64 - 1)))
        edits.append((kind, place, value, draw(st.sampled_from([1, 2, 4, 8]))))
    return edits


def damaged(raw, edits):
    data = bytearray(raw)
    for kind, place, value, width in edits:
        at = min(int(place * len(data)), max(len(data) - 1, 0))
        if kind == "byte" and data:
            data[at] = value & 255
        elif kind == "number" and at + 8 <= len(data):
            data[at : at + width] = struct.pack("<Q", value)[:width]
        elif kind == "cut":
            del data[at:]
        elif kind == "remove":
            del data[at : at + value % 64]
        elif kind == "repeat":
            data[at:at] = data[at : at + value % 4096]
        elif kind == "noise":
            noise = np.random.default_rng(value).integers(0, 256, value % 64, dtype=np.uint8)
            data[at : at + len(noise)] = noise.tobytes()
    return bytes(data)


def read_within_bounds(read, data):
    """Memory: 40 MB for tables, and 200 times the file (a byte of a mask can stand for eight tiles of 21 bytes)."""
    tracemalloc.start()
    start = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(data)
    except GridReadError:
        pass
    finally:
        seconds = time.process_time() - start
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert seconds < SECONDS
    assert peak < 40_000_000 + 200 * len(data)


@settings(max_examples=N_INPUTS, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.integers(0, 7), damage())
def test_damaged_vdb_files_are_read_or_refused(samples, which, edits):
    data = damaged(samples[which], edits)
    read_within_bounds(lambda raw: list(_read(Source(raw))), data)


@settings(max_examples=max(1, N_INPUTS // 5), deadline=None, suppress_health_check=list(HealthCheck))
@given(st.binary(max_size=400))
def test_noise_behind_a_valid_header_is_read_or_refused(samples, noise):
    raw = samples[0]
    read_within_bounds(lambda data: list(_read(Source(data))), raw[:57] + noise)


@settings(max_examples=max(1, N_INPUTS // 10), deadline=None, suppress_health_check=list(HealthCheck))
@given(edits=damage())
def test_damaged_npz_files_are_read_or_refused(tmp_path_factory, edits):
    folder = tmp_path_factory.mktemp("npz")
    path = folder / "a.npz"
    write_npz(path, [random_grid(1), random_grid(2, has_values=True)])
    path.write_bytes(damaged(path.read_bytes(), edits))
    read_within_bounds(lambda _: read_npz(path), path.read_bytes())
