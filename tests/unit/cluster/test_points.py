"""Parameter points: grids, lists and draws."""

import numpy as np
import pytest

from volery.cluster.errors import StudyError
from volery.cluster.loading import parse_study, read_study
from volery.cluster.points import points_of

LOW_HIGH = {"key": "seed", "distribution": "uniform", "low": 2.0, "high": 4.0}


def points(parameters, **keys):
    data = {"name": "a", "scenario": "hover", "parameters": parameters, **keys}
    return points_of(parse_study(data, "study"), "study")


def test_without_parameters_there_is_one_point():
    assert points({}) == ({},)


def test_a_grid_has_every_combination_in_order():
    found = points(
        {"a": {"key": "x", "values": [1, 2]}, "b": {"key": "y", "range": [0.0, 1.0], "steps": 3}}
    )
    assert [(each["a"], each["b"]) for each in found] == [
        (1, 0.0), (1, 0.5), (1, 1.0), (2, 0.0), (2, 0.5), (2, 1.0),
    ]  # fmt: skip


def test_a_list_takes_values_together():
    parameters = {"a": {"key": "x", "values": [1, 2]}, "b": {"key": "y", "values": ["u", "v"]}}
    assert points(parameters, combine="list") == ({"a": 1, "b": "u"}, {"a": 2, "b": "v"})
    parameters["b"]["values"] = ["u"]
    with pytest.raises(StudyError, match="equally many values: a 2, b 1"):
        points(parameters, combine="list")


@pytest.mark.parametrize("method", ["random", "latin_hypercube", "sobol"])
def test_draws_are_joint_repeatable_and_within_their_bounds(method):
    if method != "random":
        pytest.importorskip("scipy")
    parameters = {
        "a": LOW_HIGH,
        "b": {"key": "x", "distribution": "loguniform", "low": 1.0, "high": 100.0},
        "c": {"key": "y", "distribution": "normal", "mean": 5.0, "std": 0.1},
        "d": {"key": "z", "values": [1, 2]},
    }
    sampling = {"method": method, "samples": 64, "seed": 3}
    found = points(parameters, sampling=sampling)
    assert found == points(parameters, sampling=sampling)
    assert len(found) == 128
    a, b, c = (np.array([each[name] for each in found[:64]]) for name in "abc")
    assert 2.0 <= a.min() < 2.3 < 3.7 < a.max() <= 4.0
    assert 1.0 <= b.min() < 3.0 < 30.0 < b.max() <= 100.0
    assert abs(np.median(np.log10(b)) - 1.0) < 0.25
    assert abs(c.mean() - 5.0) < 0.06
    assert 0.05 < c.std() < 0.15
    if method != "random":  # one draw in each quarter of 16 strata
        assert (np.histogram(a, 16, (2.0, 4.0))[0] == 4).all()


def test_another_seed_draws_other_points():
    one, other = (points({"a": LOW_HIGH}, sampling={"samples": 4, "seed": s}) for s in (1, 2))
    assert one != other


def test_a_study_has_a_largest_number_of_runs():
    many = {name: {"key": "x", "range": [0.0, 1.0], "steps": 100_000} for name in "ab"}
    with pytest.raises(StudyError, match="10,000,000,000 runs; a study has at most 10,000,000"):
        points(many)


def test_a_study_may_begin_with_a_byte_order_mark(tmp_path):
    path = tmp_path / "study.toml"
    path.write_text('name = "a"\nscenario = "hover"\n', encoding="utf-8-sig")
    assert read_study(path).scenario == "hover"
