"""Pictures of a forest in every weather.

`python tests/golden/weather_pictures.py` stores them anew. With a folder, and if need be a width,
it writes large ones there to look at:

    python tests/golden/weather_pictures.py pictures 960
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import image

from volery.core import rotations
from volery.runtime.worlds import (
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
from volery.sensors.lidar import make_batch, stack_mounts
from volery.sensors.mount import make_mount
from volery.vehicle.pose_history import new_history

STORED = Path(__file__).parent / "weather"
WEATHERS = {
    "clear": {},
    "rain": {"weather": {"rain_mm_h": 30.0}},
    "snow": {"weather": {"snow_mm_h": 3.0}},
    "fog": {"weather": {"fog_visibility_m": 50.0}},
    "dust": {"weather": {"dust_visibility_m": 60.0}},
    "dusk": {"light": {"hour_of_day": 19.6, "date": "2025-06-21"}},
}
"""Keys of [world] for each picture."""
_FOREST = {
    "kind": "procedural",
    "region_m": [0.0, 0.0, 90.0, 60.0],
    "trees": 180,
    "minimum_spacing_m": 2.5,
    "species": {"broadleaf": 0.6, "conifer": 0.4},
}
_TIME_NS = 2_000_000_000


class Studio:
    """The forest, and a camera in it."""

    def __init__(self):
        self._scenario = _scenario({})
        terrain = build_terrain(self._scenario)
        forest = build_forest(self._scenario, terrain)
        self._scene = build_scene(self._scenario, terrain, forest)

    def shoot(self, weather, width=160, **options):
        """The (height, width, 3) picture in one of the `WEATHERS`, and depth if wanted."""
        scenario = _scenario(WEATHERS[weather])
        air = build_weather(scenario)
        light = light_of(scenario.world)(air)
        model = CameraModel(width=width, height=width * 3 // 4, horizontal_fov_deg=70.0, samples=4)
        attitude = rotations.from_rpy(0.0, np.radians(-2.0), np.radians(2.0))
        history = new_history([[4.0, 30.0, 2.2]], [attitude], 1_000_000)
        mounts = stack_mounts([make_mount()])
        batch = make_batch([0], [0], [_TIME_NS], [0], [0], mounts)
        falling = falling_in(air, light)
        return take(self._scene, model, light, batch, history, falling=falling, **options)

    def close(self):
        self._scene.close()


def stored(weather):
    """The stored picture (height, width, 3), bytes."""
    pixels = image.imread(STORED / f"{weather}.png")[..., :3]
    return np.round(255.0 * pixels).astype(np.uint8)


def _scenario(world):
    return parse_scenario(
        {
            "name": "golden",
            "world": {
                "terrain": {"kind": "flat", "extent_m": 200.0},
                "forest": _FOREST,
                "wind": {"velocity_m_s": [0.0, 1.5, 0.0]},
                **world,
            },
            "types": {"f450": {}},
            "uavs": [{"type": "f450", "position_m": [2.0, 30.0], "placement": "nearest_free"}],
        }
    )


def main(folder=STORED, width=160):
    studio = Studio()
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for weather in WEATHERS:
        colour = studio.shoot(weather, int(width), parts=("colour",)).colour[0]
        image.imsave(folder / f"{weather}.png", colour)
    studio.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
