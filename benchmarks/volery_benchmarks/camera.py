"""Measures images in the forest of the main job's trees, and the fleet that can take them.

The forest is that of the bench `lidar`. `rgbd_ms_*` are 640 x 480 images with 60 degrees field of
view and 200 m max range, colour with shadows and depth together, from ten free positions 2 to 5 m
above ground; `depth_ms_*` is depth alone. Figures are medians over the positions, in turns.
`realtime_camera_uavs` is the largest fleet at real-time factor 1 in which each UAV publishes
320 x 240 colour and depth at 10 Hz, beside IMU at 200 Hz and physics and control at 1 kHz.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from volery.core.workers import Workers
from volery.runtime import Simulation
from volery.scenario.load import parse_scenario
from volery.sensors.cameras.camera import take
from volery.sensors.cameras.light import make_light
from volery.sensors.cameras.model import CameraModel
from volery.sensors.lidar.lidar import make_batch, stack_mounts
from volery.sensors.mount import make_mount
from volery.world.scene import Scene
from volery.world.terrain import Terrain
from volery_benchmarks.fleet import fleet_scenario, largest
from volery_benchmarks.forest_beams import EXTENT_M, forest_of, scans_of

_NUM_UAVS = 10
_ROUNDS = 7
_SECONDS = 3.0
_CAMERA: dict[str, Any] = {
    "kind": "camera",
    "position_m": [0.12, 0.0, 0.06],
    "width": 320,
    "height": 240,
}
_PARTS = {"rgbd_ms": ("colour", "depth"), "depth_ms": ("depth",)}


def measure() -> dict[str, float]:
    """Returns the figures of the bench `camera`."""
    uavs, factor = largest(_real_time_factor, first=4, step=1)
    return {
        **_images(),
        "realtime_camera_uavs": float(uavs),
        "real_time_factor_there": factor,
    }


def _images() -> dict[str, float]:
    terrain = Terrain.flat(EXTENT_M)
    scene = Scene(terrain, forest_of(EXTENT_M, terrain))
    teams = {"1_thread": Workers(1), "2_threads": Workers(2)}
    try:
        _, history = scans_of(scene, EXTENT_M)
        mounts, model, light = stack_mounts([make_mount()]), CameraModel(), make_light()
        shots = [make_batch([uav], [0], [0], [0], [0], mounts) for uav in range(_NUM_UAVS)]

        def shoot(parts: Any, team: Workers) -> None:
            for shot in shots:
                take(scene, model, light, shot, history, parts=parts, workers=team)

        calls = {
            f"{name}_{threads}": partial(shoot, parts, team)
            for name, parts in _PARTS.items()
            for threads, team in teams.items()
        }
        return {name: 1e3 * s / _NUM_UAVS for name, s in _median_s(calls).items()}
    finally:
        for team in teams.values():
            team.close()
        scene.close()


def _median_s(calls: Mapping[str, Callable[[], None]]) -> dict[str, float]:
    """Returns the median time of each call, s, in turns, after a warm-up round."""
    seconds: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(_ROUNDS + 1):
        for name, call in calls.items():
            before = time.perf_counter()
            call()
            if turn:
                seconds[name].append(time.perf_counter() - before)
    return {name: statistics.median(each) for name, each in seconds.items()}


def _real_time_factor(uavs: int) -> float:
    scenario = parse_scenario(fleet_scenario(uavs, [_CAMERA]), where="bench camera")
    with Simulation(scenario) as simulation:
        received = 0

        def count(_message: object) -> None:
            nonlocal received
            received += 1

        for name in simulation.vehicles.names:
            for topic in ("image_raw", "depth"):
                simulation.graph.subscribe(f"/{name}/camera/{topic}", count)
        simulation.run(2.5)  # climb
        for uav in simulation.uavs.values():
            uav.command_velocity([0.3, 0.0, 0.0], 0.5)
        received = 0
        before = time.perf_counter()
        simulation.run(_SECONDS)
        factor = _SECONDS / (time.perf_counter() - before)
        if abs(received - 20 * uavs * _SECONDS) > 4 * uavs:
            raise AssertionError(f"{received} images instead of {20 * uavs * _SECONDS:.0f}")
        return factor
