"""The wind of a scenario: what is read, what is refused."""

import pytest

from volery.core.errors import ScenarioError
from volery.scenario.load import parse_scenario

GUST = {"amplitude_m_s": [3, 0, 0], "start_s": 5.0, "rise_s": 0.5}


def scenario(wind):
    return parse_scenario(
        {
            "name": "test",
            "world": {"wind": wind},
            "types": {"t": {}},
            "uavs": [{"type": "t", "position_m": [0, 0]}],
        }
    )


def test_all_of_it():
    wind = scenario(
        {
            "velocity_m_s": [3, 4, 0],
            "profile": {"kind": "power", "exponent": 0.2},
            "turbulence": "light",
            "gusts": [GUST, {"amplitude_m_s": [1, 0, 0], "start_s": 0, "rise_m": 10, "end_s": 4}],
        }
    ).world.wind
    assert wind.profile.exponent == 0.2
    assert wind.gusts[0].end_s is None
    assert wind.speed_m_s == 5.0


@pytest.mark.parametrize(
    ("wind", "words"),
    [
        ({"velocity": [1, 0, 0]}, ["unknown key 'world.wind.velocity'", "'velocity_m_s'"]),
        ({"turbulence": "some"}, ["world.wind.turbulence", "'light'", "'severe'"]),
        ({"turbulence": "light", "w20_m_s": 3}, ["turbulence and w20_m_s exclude each other"]),
        ({"w20_m_s": -1}, ["world.wind.w20_m_s", "a number of at least 0"]),
        ({"field": "a.csv", "velocity_m_s": [1, 0, 0]}, ["field replaces velocity_m_s"]),
        ({"field": "a.csv", "profile": {"kind": "log"}}, ["field replaces"]),
        ({"profile": {"kind": "linear"}}, ["world.wind.profile", "log, power"]),
        ({"profile": {"kind": "log", "roughnes_m": 1}}, ["roughnes_m", "mean 'roughness_m'"]),
        ({"profile": {"kind": "log", "roughness_m": 8}}, ["twice roughness_m"]),
        ({"profile": {"kind": "power", "exponent": 3}}, ["profile.exponent", "at most 1"]),
        ({"gusts": [GUST | {"amplitude_m_s": [99, 0, 0]}]}, ["gusts[0]", "amplitude_m_s", "60"]),
        ({"gusts": [GUST | {"rise_m": 5}]}, ["gusts[0]", "either rise_s or rise_m"]),
        ({"gusts": [GUST, GUST | {"end_s": 5.9}]}, ["gusts[1]", "end_s", "at least 6 s"]),
        (
            {"gusts": [{"amplitude_m_s": [1, 0, 0], "start_s": 0, "rise_m": 5}]},
            ["gusts[0].rise_m", "velocity_m_s", "give rise_s instead"],
        ),
        (
            {
                "velocity_m_s": [2, 0, 0],
                "gusts": [{"amplitude_m_s": [1, 0, 0], "start_s": 0, "rise_m": 5, "end_s": 4}],
            },
            ["gusts[0].end_s", "at least 5 s"],
        ),
        (
            {"gusts": [{"amplitude_m_s": [1, 0, 0], "start_s": 0, "rise_m": 0.5}]},
            ["gusts[0].rise_m", "a number of at least 1"],
        ),
        ({"gusts": [GUST] * 65}, ["world.wind.gusts", "at most 64"]),
    ],
)
def test_refusals(wind, words):
    with pytest.raises(ScenarioError) as error:
        scenario(wind)
    for word in words:
        assert word in str(error.value)
