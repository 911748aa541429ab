"""Vehicles and grounds that the control tests fly."""

import numpy as np
from standing import standing_pose

from volery.control.fleet import Fleet
from volery.control.flight_modes import FlightMode
from volery.vehicle.airframe import Airframe, load_airframe
from volery.world.terrain import Terrain
from volery.world.weather import Weather

F450 = load_airframe("f450")
FLAT = Terrain.flat(4000.0, 0.0, (-2000.0, -2000.0))
LEVEL = [0.0, 0.0, 0.0, 1.0]


def ring(count, **changes) -> Airframe:
    """An F450 body with `count` rotors on a ring."""
    data = F450.model_dump()
    data["name"] = f"ring_{count}"
    data["body"] |= {"collision_radius_m": 0.6, **changes}
    angles = (np.arange(count) + 0.5) * 2 * np.pi / count
    data["rotors"]["places"] = [
        {
            "position_m": [0.3 * np.cos(a), 0.3 * np.sin(a), 0.02],
            "direction": "ccw" if k % 2 else "cw",
        }
        for k, a in enumerate(angles)
    ]
    return Airframe.model_validate(data)


def in_air(position=(0.0, 0.0, 50.0), airframe=F450, **options) -> Fleet:
    return Fleet([airframe], [position], [LEVEL], **options)


def on_ground(x=0.0, y=0.0, yaw=0.0, terrain=FLAT, airframe=F450, **options) -> Fleet:
    pose = standing_pose(airframe, terrain, x, y, yaw)
    return Fleet([airframe], [pose[:3]], [pose[3:]], mode=FlightMode.LANDED, **options)


def track(fleet, seconds, terrain=FLAT, wind=None, every=10, i=0):
    """Positions, velocities and tilts (rad) of UAV `i` while it flies on."""
    if wind is not None:
        fleet.set_weather(Weather(wind))
    rows = []
    for _ in range(round(seconds * 1e9 / fleet.dt_ns / every)):
        fleet.advance(every, terrain.grid)
        q = fleet.state.attitude[i]
        tilt = np.arccos(np.clip(1 - 2 * (q[0] ** 2 + q[1] ** 2), -1, 1))
        rows.append([*fleet.state.position_map[i], *fleet.state.velocity_map[i], tilt])
    rows = np.array(rows)
    return rows[:, :3], rows[:, 3:6], rows[:, 6]
