"""The safety net of changes of structure: what `tools/scenario_digests.py` calls equal."""

import copy
import importlib.util
import sys
from pathlib import Path

import pytest

FILE = Path(__file__).parents[3] / "tools" / "scenario_digests.py"


@pytest.fixture(scope="module")
def tool():
    spec = importlib.util.spec_from_file_location("scenario_digests", FILE)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    del sys.modules[spec.name]


def digests(**topics):
    flight = {"digest": str(sorted(topics.items())), "by_topic": "", "topics": topics}
    return {"machine": "", "seconds": 1.0, "flights": {"hover, 1 threads": flight}}


def test_equal_flights_differ_in_nothing(tool):
    assert tool.differences(digests(a="1", b="2"), digests(a="1", b="2")) == []


@pytest.mark.parametrize(
    ("after", "line"),
    [
        ({"a": "1", "c": "2"}, "b is renamed c"),
        ({"a": "1", "b": "3"}, "b has changed"),
        ({"a": "1"}, "b is gone"),
        ({"a": "1", "b": "2", "c": "3"}, "c is new"),
    ],
)
def test_each_kind_of_difference_has_a_line(tool, after, line):
    found = tool.differences(digests(a="1", b="2"), digests(**after))
    assert found == [f"hover, 1 threads: {line}"]


def test_equal_topics_in_another_order_are_a_difference(tool):
    before = digests(a="1")
    after = copy.deepcopy(before)
    after["flights"]["hover, 1 threads"]["digest"] = "another"
    assert tool.differences(before, after) == ["hover, 1 threads: states or the order of messages"]


def test_flights_of_other_scenarios_and_lengths_are_named(tool):
    before, after = digests(a="1"), digests(a="1")
    after["seconds"] = 2.0
    after["flights"] = {"coverage, 1 threads": after["flights"]["hover, 1 threads"]}
    assert tool.differences(before, after) == [
        "flown for 1 s and 2 s",
        "hover, 1 threads: only before",
        "coverage, 1 threads: only after",
    ]


def test_a_flight_is_repeated_to_the_byte_and_a_longer_one_is_another(tool):
    first, again, longer = (tool.fly("hover", 1, seconds) for seconds in (0.2, 0.2, 0.3))
    assert first == again
    assert first["digest"] != longer["digest"]
    assert first["topics"]["/uav1/imu"] != longer["topics"]["/uav1/imu"]
