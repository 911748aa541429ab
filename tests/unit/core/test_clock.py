"""Tests that simulated time does not drift."""

from hypothesis import given
from hypothesis import strategies as st

from volery.core.clock import Schedule, ns_from_s, s_from_ns, stamp_from_ns


def test_thirty_hertz_does_not_drift():
    schedule = Schedule.from_hz(30.0)
    assert schedule.instant_ns(30 * 3600) == 3600 * 1_000_000_000
    assert schedule.period_ns == 33_333_333


@given(st.floats(0.1, 1000.0), st.integers(0, 10**6), st.integers(0, 10**9))
def test_instants_are_evenly_spaced_to_a_nanosecond(rate, k, phase):
    schedule = Schedule.from_hz(rate, phase)
    step = schedule.instant_ns(k + 1) - schedule.instant_ns(k)
    assert abs(step - 1e9 / rate) <= 1.0


def test_conversions():
    assert ns_from_s(1.5) == 1_500_000_000
    assert s_from_ns(1_500_000_000) == 1.5
    assert stamp_from_ns(3_000_000_007) == (3, 7)
