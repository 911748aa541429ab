"""Banks of navigation sensors without a simulation: a fleet that stands where a test puts it."""

import numpy as np

from volery.control.fleet import Fleet
from volery.core.clock import Schedule
from volery.core.geodesy import LocalFrame
from volery.sensors.gnss import GnssBank, GnssModel
from volery.sensors.gnss_denial import NOWHERE
from volery.sensors.samples import SensorId
from volery.vehicle.airframe import load_airframe

ZURICH = LocalFrame.from_degrees(47.397742, 8.545594, 488.0)
LEVEL = (0.0, 0.0, 0.0, 1.0)
NS = 1_000_000_000


def fleet_of(count=1, position=(0.0, 0.0, 10.0), attitude=LEVEL):
    return Fleet([load_airframe("f450")] * count, [position] * count, [attitude] * count)


def put(fleet, position, attitude=LEVEL):
    """Let all UAVs have stood at a place for ever."""
    fleet.state.position_map[:] = position
    fleet.state.attitude[:] = attitude
    fleet.history.position[:] = position
    fleet.history.attitude[:] = attitude


def sensors_of(count, name="fix"):
    """Many sensors, all of them on the first UAV."""
    return tuple(SensorId(0, f"u{i}", name) for i in range(count))


def keys_of(count, first=11):
    return np.arange(first, first + count, dtype=np.uint64)


def gnss_bank(count=1, *, noise=False, denial=NOWHERE, lever=(0.0, 0.0, 0.0), **changes):
    return GnssBank(
        GnssModel.load("gnss_m8").model_copy(update=changes),
        Schedule.from_hz(5.0),
        sensors_of(count),
        np.tile(np.array(lever), (count, 1)),
        keys_of(count) if noise else None,
        ZURICH,
        denial,
    )
