"""Whether what is seen goes on as it was: displacements, and what only looks like one."""

from __future__ import annotations

import numpy as np
import pytest

from volery.autonomy.slam.kidnapping_detection import KidnappingDetector

RATE_HZ = 20
PERIOD_NS = 1_000_000_000 // RATE_HZ
BEAMS = np.linspace(-np.pi, np.pi, 180, endpoint=False)


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def forest(rng, per_m2=0.02):
    """Trunks (K, 2) around the path along x."""
    return rng.uniform([-60.0, -60.0], [60.0, 60.0], (round(per_m2 * 120 * 120), 2))


def sweep(trunks, here, max_range_m=20.0, radius_m=0.2):
    """Returns points (K, 2) of the trunks in range, relative to `here`."""
    away = trunks - here
    distance = np.hypot(*away.T)
    bearing = np.arctan2(away[:, 1], away[:, 0])
    off = np.abs((BEAMS[:, None] - bearing + np.pi) % (2 * np.pi) - np.pi)
    met = (distance < max_range_m) & (distance * np.sin(np.minimum(off, np.pi / 2)) < radius_m)
    nearest = np.where(met, distance, np.inf).min(1)
    seen = np.isfinite(nearest)
    return nearest[seen, None] * np.stack([np.cos(BEAMS), np.sin(BEAMS)], 1)[seen]


class Flight:
    """One that believes to fly along x at 2.5 m/s."""

    def __init__(self, trunks):
        self.trunks, self.sight = trunks, KidnappingDetector()
        self.time_ns, self.moved = 0, np.zeros(2)

    def fly(self, seconds, seen=None):
        for _ in range(round(seconds * RATE_HZ)):
            self.time_ns += PERIOD_NS
            here = np.array([2.5e-9 * self.time_ns - 20.0, 0.0])
            own = sweep(self.trunks, here + self.moved) if seen is None else seen
            self.sight.take(self.time_ns, own + here, here, is_level=True)


@pytest.mark.parametrize("moved", [(0.0, 1.5), (0.0, 3.0), (-4.0, 0.0), (30.0, 5.0)])
def test_one_that_is_displaced_sees_something_else(moved, rng):
    flight = Flight(forest(rng))
    flight.fly(10.0)
    assert not flight.sight.is_broken
    flight.moved = np.array(moved)
    flight.fly(0.3)
    assert flight.sight.is_broken
    if np.hypot(*moved) < 6.0:
        assert np.abs(flight.sight.moved - moved).max() < 0.5
    else:
        assert flight.sight.moved is None


def test_things_that_come_into_sight_are_no_displacement(rng):
    """As where it leaves a clearing, and a dense wood of as many returns more appears at once."""
    flight = Flight(forest(rng))
    flight.fly(5.0)
    flight.trunks = np.concatenate([flight.trunks, forest(rng, 0.04)])
    flight.fly(3.0)
    assert not flight.sight.is_broken


def test_things_that_vanish_are_no_displacement(rng):
    flight = Flight(forest(rng, 0.05))
    flight.fly(5.0)
    flight.trunks = flight.trunks[::3]
    flight.fly(3.0)
    assert not flight.sight.is_broken


def test_a_blinded_sensor_says_nothing(rng):
    flight = Flight(forest(rng))
    flight.fly(5.0)
    flight.fly(2.0, seen=np.zeros((0, 2)))
    flight.moved = np.array([0.0, 3.0])
    flight.fly(3.0)
    assert not flight.sight.is_broken


def test_one_that_stands_still_sees_what_it_saw(rng):
    flight = Flight(forest(rng))
    seen = sweep(flight.trunks, np.zeros(2))
    for _ in range(100):
        flight.time_ns += PERIOD_NS
        flight.sight.take(flight.time_ns, seen, np.zeros(2), is_level=True)
    assert not flight.sight.is_broken
