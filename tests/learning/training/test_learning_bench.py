"""The bench `learning` runs piece by piece."""

import pytest

from volery.core.errors import VoleryError
from volery.learning.tasks import load_task
from volery_benchmarks import learning
from volery_benchmarks.learning import throughput
from volery_benchmarks.registry import BENCHES, Measured, find


def test_throughput_counts_decisions_of_all_environments():
    assert throughput.steps_per_s(load_task("homing"), 4, seconds=0.0) > 100.0


def test_parts_are_chosen_and_failures_are_listed(monkeypatch):
    def fails():
        raise VoleryError("there is no forest")

    monkeypatch.setattr(throughput, "measure_state", lambda: Measured({"a": 1.0}))
    monkeypatch.setattr(throughput, "measure_lidar", fails)
    result = find("learning").run(only=("state", "lidar"))
    assert result.figures == {"a": 1.0}
    assert result.failures == {"lidar": "there is no forest"}
    with pytest.raises(VoleryError, match="has no part 'none'"):
        learning.measure(only=["none"])
    with pytest.raises(VoleryError, match="has no parts"):
        find("lidar").run(only=("state",))


def test_every_bound_belongs_to_a_figure_of_a_part():
    names = set(BENCHES["learning"].bounds)
    known = {f"env_steps_per_s_{part}" for part in ("state", "rotor", "lidar", "depth")}
    known |= {"reset_ms_1024", "success_servoing", "success_forest"}
    known |= {f"train_s_{task}" for task in ("hover", "homing")}
    known |= {f"train_success_{task}_least" for task in ("hover", "homing")}
    assert names <= known
