"""Calls between UAVs, measured over one of the transports, and the figures made of them."""

from __future__ import annotations

from volery.bridges.rosbridge.server import RosbridgeServer
from volery_benchmarks import search
from volery_benchmarks.registry import BENCHES


def test_figures_leave_the_first_calls_out():
    took = [(9_000_000, 9_000_000)] * 20 + [(1_000_000 * k, 2_000_000 * k) for k in range(1, 12)]
    figures = search.call_figures("way", took)
    assert figures["way_one_way_ms"] == 6.0
    assert figures["way_round_trip_ms"] == 12.0
    assert figures["way_one_way_p95_ms"] == 10.5
    assert {f"{way}_one_way_ms" for way in ("lock_step", "rosbridge", "ros1")} == set(
        BENCHES["search"].bounds
    )


def test_calls_over_a_bridge_are_timed_in_both_processes(monkeypatch):
    monkeypatch.setattr(search, "_START_S", 0.5)
    monkeypatch.setattr(search, "_CALLS", 10)
    bridge = RosbridgeServer(port=0)
    with search.flying() as bridges:
        bridges.open(bridge)
        took = search.exchange("rosbridge", bridge.port)
    assert len(took) == 30
    assert all(0 < one_way < round_trip for one_way, round_trip in took)
