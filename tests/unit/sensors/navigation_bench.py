"""Banks of navigation sensors without a simulation: a fleet that stands where a test puts it."""

import numpy as np

from volery.control.fleet import Fleet
from volery.core.clock import Schedule
from volery.core.geodesy import LocalFrame
from volery.sensors.bank import SensorGroup
from volery.sensors.gnss import GnssBank, GnssModel
from volery.sensors.gnss_denial import NOWHERE
from volery.sensors.mount import make_mount
from volery.sensors.samples import SensorId
from volery.vehicle.airframe import load_airframe

ZURICH = LocalFrame.from_degrees(47.397742, 8.545594, 488.0)
LEVEL = (0.0, 0.0, 0.0, 1.0)
NS = 1_000_000_000


def fleet_of(count=1, position=(0.0, 0.0, 10.0), attitude=LEVEL):
    return Fleet([load_airframe("f450")] * count, [position] * count, [attitude] * count)


def put(fleet, position, attitude=LEVEL):
    """Let all UAVs have stood at a position for ever."""
    fleet.state.position_map[:] = position
    fleet.state.attitude[:] = attitude
    fleet.history.position[:] = position
    fleet.history.attitude[:] = attitude


def sensors_of(count, name="fix"):
    """Many sensors, all of them on the first UAV."""
    return tuple(SensorId(0, f"u{i}", name) for i in range(count))


def keys_of(count, first=11):
    return np.arange(first, first + count, dtype=np.uint64)


def group_of(count, name, rate_hz, keys, **mount):
    mounts = (make_mount(**mount),) * count
    return SensorGroup(Schedule.from_hz(rate_hz), sensors_of(count, name), mounts, keys)


def gnss_bank(count=1, *, noise=False, denial=NOWHERE, lever=(0.0, 0.0, 0.0), **changes):
    model = GnssModel.load("gnss_m8").model_copy(update=changes)
    keys = keys_of(count) if noise else None
    return GnssBank(model, group_of(count, "fix", 5.0, keys, position_body=lever), ZURICH, denial)
