"""Renders the images of the scenario cards with Volery's own camera.

    python tools/scenario_cards.py              # all shipped scenarios
    python tools/scenario_cards.py hover longleaf

An additional UAV, the photographer, carries a camera that looks at the first UAV.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np

from volery.graph.messages import Published
from volery.runtime.simulation import Simulation
from volery.scenario import library
from volery.scenario.load import load_scenario, parse_scenario
from volery.scenario.schema import Scenario
from volery.server.cards import CARDS

WIDTH, HEIGHT = 480, 270
_QUALITY = 85
"""Quality of the JPEG file, as in libjpeg: about 25 kB an image."""
_TYPE = "photographer"
_STUDIO_M = 150.0
"""Initial height of the photographer, above the highest ground."""
_EXPOSURE_S = 0.3
_DARK, _BRIGHT, _MOST_GAIN = 110.0, 215.0, 4.0
"""An image whose bright parts are below the first value is brightened to the second one."""


@dataclass(frozen=True)
class CardView:
    """Time and viewpoint of a card; the camera looks at the first UAV."""

    at_s: float = 6.0
    """Simulated time, s."""
    eye_m: tuple[float, float, float] = (-5.0, -2.5, 1.8)
    """Offset from the first UAV, map axes, m."""
    fov_deg: float = 60.0
    hour_of_day: float | None = None
    """Hour of the picture; None: the scenario's."""


VIEWS = {
    "city_flight": CardView(12.0, (-2.4, -0.9, 0.9), 70.0),
    "cooperative_search": CardView(12.0, (-1.9, -1.1, 0.8), 65.0),
    "coverage": CardView(20.0, (-2.2, -1.8, 1.3), 75.0),
    "flock": CardView(14.0, (-9.0, -7.0, 6.0), 75.0),
    "forest_cameras": CardView(10.0, (-1.7, -0.6, 0.45), 70.0),
    "forest_procedural": CardView(10.0, (-1.7, -0.7, 0.5), 70.0),
    "forest_rain": CardView(10.0, (-1.5, -0.6, 0.4), 70.0, hour_of_day=12.0),
    "forest_search": CardView(11.0, (-1.5, 1.2, 0.5), 70.0),
    "forest_survey": CardView(10.0, (-1.7, 0.7, 0.45), 70.0),
    "grid_map": CardView(10.0, (-1.5, -0.9, 0.9), 75.0),
    "hover": CardView(5.0, (-1.1, -0.7, 0.35)),
    "longleaf": CardView(10.0, (-1.7, 0.7, 0.45), 70.0),
    "obstacle_field": CardView(10.0, (-1.8, -0.9, 0.6), 70.0),
    "plug_in": CardView(10.0, (-1.9, -1.5, 1.0), 70.0),
    "policy_homing": CardView(6.0, (-1.5, -1.0, 0.6)),
    "servoing": CardView(2.3, (-1.5, -1.0, 1.4), 65.0),
    "swarm_100": CardView(8.0, (-0.5, -0.35, 0.12), 75.0),
    "v_formation": CardView(45.0, (-9.0, -7.0, 8.0), 80.0),
    "v_formation_distributed": CardView(90.0, (-12.0, -10.0, 9.0), 80.0),
}


def draw(name: str) -> bytes:
    """Returns the card of a shipped scenario as a JPEG file."""
    view = VIEWS.get(name, CardView())
    with Simulation(_with_photographer(load_scenario(name), view)) as simulation:
        simulation.run(view.at_s)
        eye = simulation.uavs["uav1"].position_map + view.eye_m
        photographer = simulation.vehicles.names[-1]
        simulation.vehicles.set_pose(photographer, eye, (0.0, 0.0, 0.0, 1.0))
        taken: list[Published] = []
        simulation.graph.subscribe(f"/{photographer}/card/image_raw", taken.append)
        simulation.run(_EXPOSURE_S)
    return _jpeg(taken[-1].message)


def _with_photographer(scenario: Scenario, view: CardView) -> Scenario:
    """Returns the scenario with an additional UAV whose camera looks against `eye_m`."""
    x, y, z = (-side for side in view.eye_m)
    pitch_deg = -math.degrees(math.atan2(z, math.hypot(x, y)))
    camera = {
        "kind": "camera",
        "name": "card",
        "width": WIDTH,
        "height": HEIGHT,
        "horizontal_fov_deg": view.fov_deg,
        "samples": 4,
        "rate_hz": 10.0,
        "rpy_deg": (0.0, pitch_deg, math.degrees(math.atan2(y, x))),
    }
    data = scenario.model_dump(exclude_unset=True)
    data["types"][_TYPE] = {"airframe": "crazyflie", "plant": "kinematic", "sensors": [camera]}
    if view.hour_of_day is not None:
        data["world"]["light"]["hour_of_day"] = view.hour_of_day
    names = [f"uav{k + 1}" for k in range(scenario.uav_count)]
    of_types = [node for kind in data["types"].values() for node in kind.get("nodes", ())]
    for node in [*data.get("nodes", ()), *of_types]:  # their teams are without the photographer
        own = node.get("parameters", {})
        node["parameters"] = {k: names if v == "{uavs}" else v for k, v in own.items()}
    first = scenario.uavs[0].position_m
    waiting = {"type": _TYPE, "position_m": (first[0], first[1], _STUDIO_M)}
    data["uavs"] = [*data["uavs"], waiting]
    return parse_scenario(data, where=scenario.name, access=scenario.access)


def _jpeg(message: Any) -> bytes:
    from PIL import Image

    pixels = np.asarray(message.data, dtype=np.uint8).reshape(message.height, message.width, 3)
    file = BytesIO()
    Image.fromarray(_exposed(pixels)).save(file, "jpeg", quality=_QUALITY, optimize=True)
    return file.getvalue()


def _exposed(pixels: np.ndarray) -> np.ndarray:
    """Returns the image as bright as a photographer exposes it; only dark ones change."""
    brightest = max(1.0, float(np.percentile(pixels, 97.0)))
    if brightest > _DARK:
        return pixels
    gain = min(_MOST_GAIN, _BRIGHT / brightest)
    return np.minimum(pixels * gain, 255.0).astype(np.uint8)


def main(names: list[str]) -> None:
    """Renders the cards of some scenarios, or of all."""
    for name in names or library.names():
        (CARDS / f"{name}.jpg").write_bytes(draw(name))
        sys.stdout.write(f"{name}\n")


if __name__ == "__main__":
    main(sys.argv[1:])
