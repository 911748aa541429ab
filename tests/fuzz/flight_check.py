"""Loads, builds and flies what is left of a scenario after changes."""

from __future__ import annotations

from collections import Counter

import numpy as np

from volery.core.errors import DivergenceError, VoleryError
from volery.runtime import Simulation

OUTCOMES = Counter()
"""How often checks of this process ended with which outcome."""
_FLOWN_S = 0.3
_LONGEST_MESSAGE = 20_000
_LONGEST_LINE = 2000


def refused_or_flown(load):
    """`load` a scenario, build it, fly it for a moment: a flight or one clear error, nothing else.

    A flight whose state stops being physical is an error, too; it is counted apart.
    """
    try:
        scenario = load()
        if not is_small(scenario):
            OUTCOMES["too large to fly here"] += 1
            return
        with Simulation(scenario, threads=1) as simulation:
            simulation.run(min(_FLOWN_S, scenario.duration_s))
            state = simulation._engine.fleet.state
            for numbers in (state.position_map, state.velocity_map, state.attitude):
                assert np.isfinite(numbers).all()
            assert np.abs(state.velocity_map).max() <= 1e4
            simulation.snapshot() if not simulation.vehicles.nodes else None
    except DivergenceError as error:
        check_message(error)
        OUTCOMES["stopped in flight"] += 1
    except VoleryError as error:
        check_message(error)
        OUTCOMES["refused"] += 1
    else:
        OUTCOMES["flown"] += 1


def refused_or_read(read):
    """`read` a file: its content, or one clear error. Returns the content, None where refused."""
    try:
        content = read()
    except VoleryError as error:
        check_message(error)
        OUTCOMES["refused"] += 1
        return None
    OUTCOMES["read"] += 1
    return content


def check_message(error):
    """An error says something, in lines of a length that a terminal can show."""
    text = str(error)
    assert text.strip()
    assert len(text) < _LONGEST_MESSAGE, len(text)
    assert max(map(len, text.splitlines())) < _LONGEST_LINE, text[:500]
    assert "Traceback" not in text


def is_small(scenario):
    """Whether it can be flown in well below a second."""
    world = scenario.world
    trees = getattr(world.forest, "trees", 0)
    cameras = [s for kind in scenario.types.values() for s in kind.sensors if s.kind == "camera"]
    pixels = sum((s.width or 640) * (s.height or 480) * s.rate_hz for s in cameras)
    rates = [getattr(s, "rate_hz", 10.0) for kind in scenario.types.values() for s in kind.sensors]
    return scenario.uav_count <= 8 and trees <= 50 and pixels <= 2e6 and sum(rates) <= 4000
