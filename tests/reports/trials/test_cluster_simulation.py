"""Simulated clusters where the answer is known on paper."""

from __future__ import annotations

import pytest

from reports.trials.cluster_simulation import Case, Costs, simulate

FREE = Costs(portion=0.0, byte=0.0, start=2.0, first=3.0, alone=0.0, rate=1e6)
CASE = Case(places=400, place_bytes=0, spp=64, scene_bytes=0, build=5.0, latency=0.0)
WORK = 400 * 64 * 1024 / 1e6  # [s] of one thread


def test_one_worker_without_costs_takes_as_long_as_its_work():
    found = simulate(CASE, FREE, 1)
    assert found.seconds == pytest.approx(10.0 + WORK)
    assert found.efficiency == pytest.approx(WORK / (10.0 + WORK)) and found.busy == 0.0


def test_workers_share_the_work_and_end_together():
    """Within the last portions, which take 0.02 s and a place's 0.05 s at most."""
    found = simulate(CASE, FREE, 8)
    assert 10.0 + WORK / 8 <= found.seconds <= 10.0 + WORK / 8 + 2.5


def test_no_portion_is_lost_and_the_server_is_a_bound():
    """Dealing out one portion a second, each of at most 0.5 s: nothing is faster."""
    found = simulate(CASE, FREE._replace(portion=1.0), 4)
    assert found.busy > 0.7
    assert found.seconds >= WORK / 0.5


def test_a_scene_that_is_passed_on_whole_doubles_at_each_step():
    """1 GB at 125 MB/s is 8 s; to 100 workers it takes 7 steps, in pieces one."""
    large = CASE._replace(scene_bytes=1e9)
    whole = simulate(large, FREE, 100)
    pieces = simulate(large._replace(pieces=True), FREE, 100)
    assert whole.seconds - pieces.seconds == pytest.approx(6 * 8.0)
