"""Images of a forest in every weather, and of every other kind of world in some.

`python tests/golden/studio.py` stores them. With a folder, and if need be a width,
it writes large ones there to look at:

    python tests/golden/studio.py images 960
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import image

from volery.core import rotations
from volery.runtime.construction.worlds import (
    build_city,
    build_forest,
    build_scene,
    build_terrain,
    build_weather,
    light_of,
)
from volery.scenario.load import parse_scenario
from volery.sensors.cameras.camera import take
from volery.sensors.cameras.model import CameraModel
from volery.sensors.cameras.precipitation import falling_in
from volery.sensors.lidar.lidar import make_batch, stack_mounts
from volery.sensors.mount import make_mount
from volery.vehicle.airframe import load_airframe
from volery.vehicle.body_shape import body_shape
from volery.vehicle.pose_history import new_history

STORED = Path(__file__).parent / "images"
WEATHERS = {
    "clear": {},
    "rain": {"weather": {"rain_mm_h": 30.0}},
    "snow": {"weather": {"snow_mm_h": 3.0}},
    "fog": {"weather": {"fog_visibility_m": 50.0}},
    "dust": {"weather": {"dust_visibility_m": 60.0}},
    "dusk": {"light": {"hour_of_day": 19.6, "date": "2025-06-21"}},
}
"""Keys of [world] for each image."""
_TIME_NS = 2_000_000_000


@dataclass(frozen=True)
class View:
    """A world ([world] keys) and where it is looked at from."""

    world: dict
    position_m: tuple[float, float, float]
    yaw_deg: float


def _stands(name, shape, position, yaw_deg=0.0):
    motion = {"kind": "external", "position_m": position, "yaw_deg": yaw_deg}
    return {"name": name, "shape": shape, "motion": motion}


VIEWS = {
    "forest": View(
        {
            "forest": {
                "kind": "procedural",
                "region_m": [0.0, 0.0, 90.0, 60.0],
                "trees": 180,
                "minimum_spacing_m": 2.5,
                "species": {"broadleaf": 0.6, "conifer": 0.4},
            }
        },
        (4.0, 30.0, 2.2),
        yaw_deg=2.0,
    ),
    "city": View(
        {
            "terrain": {"kind": "flat", "extent_m": 900.0, "height_m": 5.0},
            "origin": {"latitude_deg": 60.1716, "longitude_deg": 24.9443, "altitude_m": 0.0},
            "city": {"file": "city/helsinki_buildings.geojson"},
        },
        (-55.0, -304.6, 10.8),
        yaw_deg=0.0,
    ),
    "grid_map": View(
        {
            "grid_map": {
                "maps": [{"file": "gridmaps/random-32-32-10.map"}],
                "cell_size_m": 3.0,
                "block_height_m": 5.0,
            },
            "actors": [
                _stands("walker", "person", (-3.0, 47.0), 200.0),
                _stands("parked", "car", (4.0, 50.5), 30.0),
                _stands("gull", "bird", (-5.5, 48.6, 3.0), 90.0),
            ],
        },
        (-8.0, 48.0, 2.2),
        yaw_deg=0.0,
    ),
}


class Studio:
    """A world, and a camera in it."""

    def __init__(self, view):
        self._view = VIEWS[view]
        self._scenario = self._in({})
        terrain = build_terrain(self._scenario)
        city = build_city(self._scenario, terrain)
        forest = build_forest(self._scenario, terrain, city)
        self._scene = build_scene(self._scenario, terrain, forest, city)
        self._scene.set_bodies([body_shape(load_airframe("f450"))], [0])  # whose camera it is
        self._scene.move_actors(_TIME_NS, _TIME_NS)

    def shoot(self, weather, width=160, **options):
        """The (height, width, 3) image in one of the `WEATHERS`, and depth if wanted."""
        scenario = self._in(WEATHERS[weather])
        air = build_weather(scenario)
        light = light_of(scenario.world)(air)
        model = CameraModel(width=width, height=width * 3 // 4, horizontal_fov_deg=70.0, samples=4)
        attitude = rotations.from_rpy(0.0, np.radians(-2.0), np.radians(self._view.yaw_deg))
        history = new_history([self._view.position_m], [attitude], 1_000_000)
        mounts = stack_mounts([make_mount()])
        batch = make_batch([0], [0], [_TIME_NS], [0], [0], mounts)
        falling = falling_in(air, light)
        return take(self._scene, model, light, batch, history, falling=falling, **options)

    def close(self):
        self._scene.close()

    def _in(self, weather):
        return parse_scenario(
            {
                "name": "golden",
                "world": {
                    "terrain": {"kind": "flat", "extent_m": 200.0},
                    "wind": {"velocity_m_s": [0.0, 1.5, 0.0]},
                    **self._view.world,
                    **weather,
                },
                "types": {"f450": {}},
                "uavs": [{"type": "f450", "position_m": [2.0, 30.0]}],
            }
        )


def stored(view, weather):
    """The stored image (height, width, 3), bytes."""
    pixels = image.imread(STORED / f"{view}_{weather}.png")[..., :3]
    return np.round(255.0 * pixels).astype(np.uint8)


def main(folder=STORED, width=160):
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for view in VIEWS:
        studio = Studio(view)
        for weather in WEATHERS:
            colour = studio.shoot(weather, int(width), parts=("colour",)).colour[0]
            image.imsave(folder / f"{view}_{weather}.png", colour)
        studio.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
