"""The bench `hostile`: its figures, and that its clients attack and measure a run."""

from __future__ import annotations

import pytest

from volery_benchmarks.hostile import measuring
from volery_benchmarks.registry import BENCHES


def test_calls_without_an_answer_count_as_the_longest():
    answers = [(0.02 * k, 0.02 * k + 0.001, 5.0 + 0.02 * k) for k in range(50)]
    figures = measuring.call_figures(answers, 50)
    assert figures["rtf"] == pytest.approx(1.0)
    assert figures["delay_p99_ms"] == pytest.approx(1.0)
    assert measuring.call_figures(answers, 60)["delay_p99_ms"] == 10_000.0
    assert measuring.call_figures([], 60) == {"rtf": 0.0, "delay_p99_ms": 10_000.0}


def test_the_worst_attack_counts(monkeypatch):
    monkeypatch.setattr(measuring, "ATTACKS", {"a": None, "b": None})
    figures = {
        "none_rtf": 0.5, "a_rtf": 0.9, "b_rtf": 1.0, "a_delay_p99_ms": 3.0, "b_delay_p99_ms": 4.0,
        "a_memory_mb": 6.0, "b_memory_mb": 5.0,
    }  # fmt: skip
    worst = measuring.worst_figures(figures)
    assert set(worst) == set(BENCHES["hostile"].bounds)
    assert list(worst.values()) == [0.9, 4.0, 6.0]


@pytest.mark.slow
def test_a_run_is_attacked_and_measured(monkeypatch):
    attacks = {name: measuring.ATTACKS[name] for name in ("publisher_10_khz", "mavlink_flood")}
    monkeypatch.setattr(measuring, "ATTACKS", attacks)
    figures = measuring.measure(quick=True).figures
    assert figures["none_rtf"] > 0.0
    assert figures["publisher_10_khz_sent"] > 0
    assert figures["mavlink_flood_sent"] > 0
    assert figures["mavlink_flood_rtf"] > 0.0
    assert set(BENCHES["hostile"].bounds) <= set(figures)
