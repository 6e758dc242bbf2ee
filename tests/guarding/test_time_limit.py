"""A time limit holds for every stage, and what is said is true whenever it ends; the clock is the test's own."""

import os
import signal
import threading
from importlib import import_module

import pytest
import shapes

import voxkernel
from voxkernel.demo_shapes import torus

clock, cover, guards, measuring = (
    import_module(f"voxkernel.guarding.{name}") for name in ("clock", "cover", "guards", "measuring")
)

COMB = voxkernel.as_mesh(
    shapes.prism([(0, 0), (7, 0), (7, 4), (6, 4), (6, 1), (4, 1), (4, 4), (3, 4), (3, 1), (1, 1), (1, 4), (0, 4)])
)


@pytest.fixture
def now(monkeypatch):
    """Time stands still unless the test moves it; fewer samples and candidates, so that tests do not take long."""
    time = [0.0]
    monkeypatch.setattr(clock, "perf_counter", lambda: time[0])
    monkeypatch.setattr(cover, "_N_START", 100)
    for module in (guards, measuring):
        monkeypatch.setattr(module, "FRESH", 20_000)
    return time


@pytest.mark.parametrize(("stage", "threads"), [("search", 1), ("confirm", 1), ("certify", 2), ("bound", 1)])
def test_what_a_stage_has_no_time_for_is_said(stage, threads, now):
    def told(state):
        if state.stage == stage:
            now[0] = 2.0

    found = voxkernel.guards(COMB, bound=True, time_limit=1.0, progress=told, threads=threads)
    assert len(found) >= 1
    assert found.is_reached == (found.reason == "")
    assert ("`seen` is measured on 4,000 samples" in found.left_out) == (stage in ("search", "confirm"))
    assert found.n_samples == (4000 if stage in ("search", "confirm") else 20_000)
    assert (f"{len(COMB.faces)} facets are not looked at for `certified`" in found.left_out) == (stage != "bound")
    assert (found.certified > 0.9) == (stage == "bound")
    assert found.left_out == "" if stage == "bound" else found.left_out.startswith("the time limit is over: ")
    assert found.bound.reason == "the time limit is over"
    assert found.at_least == 1
    assert found.to_dict()["left_out"] == found.left_out
    low, high = found.seen_bounds
    assert found.certified <= low <= found.seen <= high <= found.facing_bound
    pieces = voxkernel.star_cover(found)
    assert pieces.verify()
    assert pieces.left_shares.sum() == pytest.approx(0 if stage == "bound" else len(COMB.faces))


def test_the_command_says_what_there_was_no_time_for(now, tmp_path, capsys, monkeypatch):
    from voxkernel.cli import main as cli

    def ticking():
        now[0] += 1.0
        return now[0]

    monkeypatch.setattr(clock, "perf_counter", ticking)
    COMB.write(tmp_path / "comb.ply")
    assert cli.main(["guards", str(tmp_path / "comb.ply"), "--time-limit", "3", "--bound"]) == 0
    shown = capsys.readouterr().out
    assert "the time limit is over" in shown
    assert "are not looked at for `certified`" in shown
    assert "may be more: the time limit is over" in shown


@pytest.mark.parametrize("ticks", [1, 40, 150])
def test_whenever_the_time_is_over_numbers_are_true(ticks, now, monkeypatch):
    """Each look at the clock takes a second."""

    def ticking():
        now[0] += 1.0
        return now[0]

    monkeypatch.setattr(clock, "perf_counter", ticking)
    found = voxkernel.guards(COMB, bound=True, time_limit=float(ticks))
    assert 1 <= len(found) <= 6
    low, high = found.seen_bounds
    assert 0.0 <= found.certified <= low <= found.seen <= high <= found.facing_bound <= 1.0
    assert found.at_least <= 3  # three see it
    assert found.bound.at_least_for_samples <= 3
    assert found.is_reached == (found.reason == "")
    monkeypatch.undo()
    true = voxkernel.guards(COMB, candidates=found.points, max_guards=len(found), coverage=1.0)
    assert low - 1e-3 <= true.seen <= high + 1e-3
    assert found.certified <= true.certified + 1e-12


def test_an_interrupt_ends_it_in_the_middle():
    mesh = torus(n_major=320, n_minor=160)
    timer = threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT))
    told = []
    with pytest.raises(KeyboardInterrupt):  # noqa: PT012
        timer.start()
        voxkernel.guards(mesh, coverage=0.9999, progress=told.append)
        timer.join()
    assert not any(state.stage == "certify" for state in told)
