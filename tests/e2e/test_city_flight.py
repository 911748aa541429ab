"""The city that ships, flown."""

import json
import math

import numpy as np
import pytest

from volery import Simulation, load_scenario
from volery.core.errors import DataFileError, PlacementError, ScenarioError
from volery.scenario.load import parse_scenario


def test_three_uavs_set_out_through_the_streets():
    with Simulation(load_scenario("city_flight")) as simulation:
        start = {name: uav.position_map for name, uav in simulation.uavs.items()}
        simulation.run(24.0)
        names = {
            simulation.world.scene.instance_name(1 + len(simulation.world.forest) + k)
            for k in (0, 480)
        }
        assert names == {"building 4253124", "lamp 1"}
        for uav in simulation.uavs.values():
            assert not uav.crashed
            assert uav.position_map[2] - 5.0 == pytest.approx(4.0, abs=0.8)
        positions = np.array([uav.position_map for uav in simulation.uavs.values()])
        flown = np.linalg.norm(positions - np.array(list(start.values())), axis=1)
        assert flown.min() > 5.0
        assert flown.max() < 60.0
        assert (
            simulation.world.scene.clearance(positions, 50.0, include_terrain=False).distance.min()
            > 0.8
        )


def town(flat_data, tmp_path, **city):
    """A block of 60 m x 60 m around the map's origin (in Zurich), 20 m tall."""
    north = 30.0 / 111_200.0
    east = north / math.cos(math.radians(47.397742))
    corners = ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
    ring = [[8.545594 + x * east, 47.397742 + y * north] for x, y in corners]
    block = {
        "type": "Feature",
        "properties": {"id": "b1", "height": 20},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }
    file = tmp_path / "town.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": [block]}))
    flat_data["world"] = {"city": {"file": str(file), **city}}
    return flat_data


def test_no_uav_starts_inside_a_building(simulate, flat_data, tmp_path):
    """Thirty metres from the nearest wall, but inside; `nearest_free` goes to the street."""
    data = town(flat_data, tmp_path)
    data["uavs"][0]["position_m"] = [0.0, 0.0]
    with pytest.raises(PlacementError, match="lies inside building b1"):
        simulate(data)
    data["uavs"][0].update(position_m=[22.0, 0.0], placement="nearest_free")
    x, y, _ = simulate(data).uavs["uav1"].position_map
    assert max(abs(x), abs(y)) > 31.0


def test_errors_of_a_city_name_scenario_and_key(simulate, flat_data, tmp_path):
    with pytest.raises(DataFileError, match=r"world\.city: no file 'none.geojson'"):
        simulate({**flat_data, "world": {"city": {"file": "none.geojson"}}})
    shipped = {"city": {"file": "city/helsinki_buildings.geojson"}}
    with pytest.raises(DataFileError, match=r"1\d\d\d km from the map's origin.*60\.169"):
        simulate({**flat_data, "world": shipped})
    with pytest.raises(ScenarioError, match=r"world\.city\.streets: .*species"):
        simulate(flat_data | _grove())
    with pytest.raises(ScenarioError, match=r"world\.city.*lamp_spacing_m must be 0"):
        parse_scenario(town(dict(flat_data), tmp_path, streets={"lamp_spacing_m": 0.5}))


def _grove():
    """Central Helsinki, whose streets have trees of an unknown species."""
    return {
        "world": {
            "terrain": {"kind": "flat", "extent_m": 900.0},
            "origin": {"latitude_deg": 60.1716, "longitude_deg": 24.9443},
            "city": {
                "file": "city/helsinki_buildings.geojson",
                "region_m": [-100.0, -450.0, 250.0, -180.0],
                "streets": {"tree_species": "oaks"},
            },
        }
    }
