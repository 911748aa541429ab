"""A short run of every parser; hypothesis shrinks what fails. Millions: `long_run.py`."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mutation import Mutator
from targets import BUILT, LOADED, TARGETS

every_parser = pytest.mark.parametrize("name", TARGETS)
_LOGS = ("mcap", "bag", "damaged_mcap", "damaged_bag")
_CHECKS = {
    **dict.fromkeys(_LOGS, 100),
    **dict.fromkeys(BUILT, 8),
    **dict.fromkeys(LOADED, 60),
}
_PARSERS = [name for name in TARGETS if name not in BUILT]


@every_parser
def test_valid_frames_with_a_few_changes_do_no_harm(name):
    for number in range(_CHECKS.get(name, 500)):
        TARGETS[name](Mutator(random.Random(f"short {name} {number}")))


@pytest.mark.parametrize("name", _PARSERS)
@settings(max_examples=50, suppress_health_check=[HealthCheck.too_slow], derandomize=True)
@given(draws=st.randoms(use_true_random=False))
def test_chosen_changes_do_no_harm(name, draws):
    TARGETS[name](Mutator(draws))


def test_the_same_draws_make_the_same_frames():
    seeds = [bytes(range(50)), b"x" * 20]
    one, other = (Mutator(random.Random("a")) for _ in range(2))
    assert [one.bytes(seeds) for _ in range(50)] == [other.bytes(seeds) for _ in range(50)]
    value = {"a": [1, 2, {"b": "c"}]}
    changed = [one.plain(value) for _ in range(50)]
    assert changed == [other.plain(value) for _ in range(50)] or "nan" in repr(changed)
    assert value == {"a": [1, 2, {"b": "c"}]}


def test_a_long_run_reports_what_it_did():
    script = Path(__file__).with_name("long_run.py")
    command = [sys.executable, str(script), "--seconds", "0.2", "type_names"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert "type_names: " in done.stdout
    assert "frames" in done.stdout
