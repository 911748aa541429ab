"""From the wind of a scenario to the air around its UAVs, while it runs too."""

import numpy as np
import pytest

from volery.core.errors import DataFileError
from volery.runtime.construction.worlds import build_weather
from volery.scenario.load import load_scenario, parse_scenario
from volery.world.weather import W20_M_S, Gust, LogProfile, PowerProfile, Weather


def weather_of(data, wind):
    return build_weather(parse_scenario({**data, "world": {"wind": wind}}))


def test_every_key_arrives(flat_data):
    assert weather_of(flat_data, {}) == Weather()
    got = weather_of(
        flat_data,
        {
            "velocity_m_s": [3, 4, 0],
            "profile": {"kind": "log", "roughness_m": 0.5},
            "turbulence": "moderate",
            "gusts": [
                {"amplitude_m_s": [1, 0, 0], "start_s": 2, "rise_s": 0.5},
                {"amplitude_m_s": [0, 0, 2], "start_s": 3, "rise_m": 10, "end_s": 9},
            ],
        },
    )
    assert got == Weather(
        (3, 4, 0),
        LogProfile(10.0, 0.5),
        w20_m_s=W20_M_S["moderate"],
        gusts=(
            Gust((1, 0, 0), 2.0, 0.5),
            Gust((0, 0, 2), 3.0, 2.0, 9.0, front_velocity_map=(3, 4, 0)),
        ),
    )
    assert got.w20_m_s == pytest.approx(15.43, abs=0.01)
    power = weather_of(flat_data, {"profile": {"kind": "power"}, "w20_m_s": 3.0})
    assert (power.profile, power.w20_m_s) == (PowerProfile(), 3.0)


def test_a_field_is_found_beside_the_scenario(flat_data, tmp_path):
    (tmp_path / "wind.csv").write_text("x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s\n0,0,0,1,2,3\n")
    (tmp_path / "s.toml").write_text(
        'name = "s"\nuavs = [{type = "t", position_m = [0, 0]}]\n[types.t]\n'
        '[world.wind]\nfield = "wind.csv"\n'
    )
    weather = build_weather(load_scenario(tmp_path / "s.toml"))
    assert weather.field is not None
    assert weather.field.velocity_map.tolist() == [[[[1, 2, 3]]]]
    with pytest.raises(DataFileError, match=r"flat: world\.wind\.field: no file 'none.npz'"):
        weather_of(flat_data, {"field": "none.npz"})


def test_a_run_in_turbulence_is_the_same_however_it_is_cut(simulate, flat_data):
    flat_data["world"] = {"wind": {"velocity_m_s": [3, 0, 0], "turbulence": "light"}}
    digests, air = [], []
    for cuts in ([2.0], [0.013, 0.5, 0.487, 1.0]):
        simulation = simulate(flat_data)
        simulation.diagnostics.enable_digest()
        (uav,) = simulation.uavs.values()
        uav.take_off()
        for cut in cuts:
            simulation.run(cut)
        digests.append(simulation.diagnostics.digest())
        air.append(simulation._engine.fleet.state.air_velocity_map.copy())
    assert digests[0] == digests[1]
    assert np.abs(air[0] - [3, 0, 0]).max() > 1e-3


def test_weather_changes_while_it_runs(simulate, flat_data):
    simulation = simulate(flat_data)
    (uav,) = simulation.uavs.values()
    uav.take_off()
    simulation.run(2.0)
    simulation.world.gust_now((4.0, 0.0, 0.0), rise_s=0.2, lasts_s=1.0)
    assert simulation.world.weather.gusts == (Gust((4, 0, 0), 2.0, 0.2, 3.0),)
    simulation.run(0.5)
    air = simulation._engine.fleet.state.air_velocity_map
    np.testing.assert_array_equal(air, [[4, 0, 0]])
    simulation.run(0.6)
    assert not air.any()
    simulation.world.set_weather(Weather((0.0, 1.0, 0.0)))
    simulation.run(0.01)
    np.testing.assert_array_equal(air, [[0, 1, 0]])
