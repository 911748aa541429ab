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
        "viewers_1000_peak_mb": 170.0, "subscribers_120_stopped_rtf": 0.98,
    }  # fmt: skip
    worst = measuring.worst_figures(figures)
    assert set(worst) == set(BENCHES["hostile"].bounds)
    assert list(worst.values()) == [170.0, 0.98, 0.9, 4.0, 6.0]


@pytest.mark.slow
def test_a_run_is_attacked_and_measured(monkeypatch):
    attack = {"publisher_10_khz": measuring.ATTACKS["publisher_10_khz"]}
    monkeypatch.setattr(measuring, "ATTACKS", attack)
    figures = measuring.measure(quick=True).figures
    assert figures["publisher_10_khz_sent"] > 0
    assert figures["none_rtf"] > 0.0
    assert {"rtf_under_attack", "memory_growth_mb"} <= set(figures)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("attack", "figure"),
    [
        ("viewers_1000", "memory_growth_1000_viewers_mb"),
        ("subscribers_120_stopped", "rtf_120_stopped_subscribers"),
    ],
)
def test_crowds_attack_a_run(monkeypatch, attack, figure):
    monkeypatch.setattr(measuring, "ATTACKS", {attack: measuring.ATTACKS[attack]})
    figures = measuring.measure(quick=True).figures
    assert figures[f"{attack}_sent"] > 0
    assert figures[figure] > 0.0


@pytest.mark.slow
def test_a_run_is_flooded_by_mavlink(monkeypatch):
    attack = {"mavlink_flood": measuring.ATTACKS["mavlink_flood"]}
    monkeypatch.setattr(measuring, "ATTACKS", attack)
    figures = measuring.measure(quick=True).figures
    assert figures["mavlink_flood_sent"] > 0
    assert figures["mavlink_flood_rtf"] > 0.0
