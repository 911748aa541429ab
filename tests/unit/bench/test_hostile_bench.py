"""The bench `hostile`: its figures, and that its clients attack and measure a run."""

from __future__ import annotations

import pytest

from volery_benchmarks.hostile import measuring
from volery_benchmarks.registry import BENCHES


def test_calls_without_an_answer_count_as_the_longest():
    responses = [(0.02 * k, 0.02 * k + 0.001, 5.0 + 0.02 * k) for k in range(50)]
    figures = measuring.call_figures(responses, 50)
    assert figures["rtf"] == pytest.approx(1.0)
    assert figures["delay_p99_ms"] == pytest.approx(1.0)
    assert measuring.call_figures(responses, 60)["delay_p99_ms"] == 10_000.0
    assert measuring.call_figures([], 60) == {"rtf": 0.0, "delay_p99_ms": 10_000.0}


def test_the_worst_attack_counts(monkeypatch):
    monkeypatch.setattr(measuring, "ATTACKS", {"a": None, "b": None})
    figures = {
        "none_rtf": 0.5, "a_rtf": 0.9, "b_rtf": 1.0, "a_delay_p99_ms": 3.0, "b_delay_p99_ms": 4.0,
        "a_memory_mb": 6.0, "b_memory_mb": 5.0,
        "viewers_1000_peak_mb": 170.0, "subscribers_120_stopped_rtf": 0.98,
    }  # fmt: skip
    worst = measuring.worst_figures(figures)
    assert set(worst) == set(BENCHES["hostile"].bounds)
    assert list(worst.values()) == [170.0, 0.98, 0.9, 4.0, 6.0]


@pytest.mark.slow
def test_a_run_is_attacked_and_measured(monkeypatch):
    names = ("publisher_10_khz", "mavlink_flood", "viewers_1000", "subscribers_120_stopped")
    attacks = {name: measuring.ATTACKS[name] for name in names}
    monkeypatch.setattr(measuring, "ATTACKS", attacks)
    figures = measuring.measure(quick=True).figures
    assert figures["none_rtf"] > 0.0
    for name in names:
        assert figures[f"{name}_sent"] > 0
        assert figures[f"{name}_rtf"] > 0.0
    assert set(BENCHES["hostile"].bounds) <= set(figures)
    assert figures["memory_growth_1000_viewers_mb"] > 0.0
