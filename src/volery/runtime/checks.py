"""Checks numbers that users pass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from volery.core.errors import CommandError
from volery.scenario.schema import Scenario


def check_steps(steps: Any) -> None:
    """Raises `CommandError` if `steps` is not a whole number or is negative."""
    if not _is_whole(steps) or steps < 0:
        raise CommandError(f"steps must be a whole number, not negative, not {steps!r}")


def check_seconds(seconds: Any) -> None:
    """Raises `CommandError` if `seconds` is not finite or is negative."""
    number = isinstance(seconds, int | float | np.number)
    if not (number and math.isfinite(seconds) and seconds >= 0.0):
        raise CommandError(f"seconds must be finite and not negative, not {seconds!r}")


def check_timeout(timeout_s: Any) -> None:
    """Raises `CommandError` if `timeout_s` is not a number or is negative; infinity is allowed."""
    number = isinstance(timeout_s, int | float | np.number) and not isinstance(timeout_s, bool)
    if not (number and timeout_s >= 0.0):
        raise CommandError(
            f"timeout_s must be a number of seconds, not negative, not {timeout_s!r}; "
            "math.inf waits without limit"
        )


def check_reset_seed(scenario: Scenario, seed: Any) -> None:
    """Raises `CommandError` if a reset to `seed` would differ from a fresh run with it.

    A reset keeps the world, so the seed cannot change if it also generates the world.
    """
    check_seed(seed)
    if scenario.has_seeded_world and seed != scenario.seed:
        raise CommandError(
            f"a reset keeps the world, which scenario '{scenario.name}' generates from its seed "
            f"{scenario.seed}, so a reset to seed {seed} is not possible. For another world make a "
            f"new simulation of scenario.with_(seed={seed}). To reset in this world, fix it first: "
            f'scenario.with_(world={{"seed": {scenario.seed}}})'
        )


def check_reset_seeds(scenario: Scenario, seeds: Sequence[Any]) -> None:
    """Raises `CommandError` if `check_reset_seed` refuses one of `seeds`; many are checked fast."""
    plain = all(type(seed) is int for seed in seeds) and not scenario.has_seeded_world
    if not (plain and seeds and min(seeds) >= 0 and max(seeds) < 2**63):
        for seed in seeds:
            check_reset_seed(scenario, seed)


def check_seed(seed: Any) -> None:
    """Raises `CommandError` if `seed` is not a valid scenario seed (0 to 2^63 - 1)."""
    if not (_is_whole(seed) and 0 <= seed < 2**63):
        raise CommandError(f"a seed must be a whole number from 0 to 2^63 - 1, not {seed!r}")


def _is_whole(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)
