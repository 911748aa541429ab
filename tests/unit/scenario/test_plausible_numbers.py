"""Schemas refuse numbers that no real object has, and accept those that real objects have."""

import pytest
from pydantic import BaseModel

from volery.core.errors import DataFileError, ScenarioError
from volery.scenario.base import Bounded, implausible
from volery.scenario.data_files import load_data_file
from volery.scenario.load import parse_scenario


class Unbounded(BaseModel):
    mass_kg: float = 1.0
    inner: "Unbounded | None" = None


def test_data_of_models_without_bounds_is_checked_after_loading(tmp_path):
    assert implausible(Unbounded()) is None
    assert implausible(Unbounded(inner=Unbounded(mass_kg=1e9)))[0] == "inner.mass_kg"
    path = tmp_path / "x.toml"
    path.write_text("inner = {mass_kg = 5000.0}")
    with pytest.raises(DataFileError, match=r"x.toml: key 'inner.mass_kg': .*given in g\?"):
        load_data_file(path, Unbounded)


def test_every_schema_has_bounds():
    """Data of users: all models but those of clients' programs, which have none to bound."""
    import volery.control.estimator.settings
    import volery.scenario.schema
    import volery.sensors.cameras.model
    import volery.sensors.lidar.lidar_model
    import volery.vehicle.airframe
    import volery.world.trees.species  # noqa: F401

    loose = [
        f"{model.__module__}.{model.__name__}"
        for model in BaseModel.__subclasses__()
        if model.__module__.startswith("volery.") and model is not Bounded
    ]
    allowed = ("volery.vehicle.identified.", "volery.bridges.", "volery.scenario.load.")
    assert [name for name in loose if not name.startswith(allowed)] == []


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("position_m", [1e308, 0.0, 0.0]),
        ("position_m", [150.0, 0.0, 0.0]),
        ("rpy_deg", [0.0, 1e6, 0.0]),
        ("rate_hz", 1e-300),
        ("phase_s", 1e300),
    ],
)
def test_a_sensor_sits_on_its_uav(flat_data, key, value):
    flat_data["types"]["f450"]["sensors"][1][key] = value
    with pytest.raises(ScenarioError, match=rf"sensors\[1\].{key}"):
        parse_scenario(flat_data)


def test_worlds_of_ten_kilometres_are_real(flat_data):
    flat_data["world"] = {"terrain": {"kind": "flat", "extent_m": 10_000.0}}
    flat_data["uavs"][0]["position_m"] = [9000.0, -9000.0]
    scenario = parse_scenario(flat_data)
    assert scenario.world.terrain.extent_m == 10_000.0
    assert tuple(scenario.uavs[0].position_m) == (9000.0, -9000.0)


def test_a_world_of_1e308_m_is_none(flat_data):
    flat_data["world"] = {"terrain": {"kind": "flat", "extent_m": 1e308}}
    with pytest.raises(ScenarioError, match=r"world.terrain.extent_m': 1e\+308 m is beyond"):
        parse_scenario(flat_data)
