"""Encoders of nodding mounts: tilt angles of LIDARs."""

from __future__ import annotations

import numpy as np

from volery.control.fleet import Fleet
from volery.core.arrays import read_only
from volery.core.clock import NS_PER_S, Schedule
from volery.sensors.bank import Memoryless, SensorGroup
from volery.sensors.mount import Mount, nodding_angle_at
from volery.sensors.samples import JointAngles, SensorId

_RATE_HZ = 80.0
_DIFFERENCE_NS = 1_000_000


class JointBank(Memoryless):
    """Encoders of all nodding mounts, sampled at 80 Hz."""

    name = "joints"
    lag_ns = 0

    def __init__(self, sensors: tuple[SensorId, ...], mounts: tuple[Mount, ...]) -> None:
        super().__init__(SensorGroup(Schedule.from_hz(_RATE_HZ), sensors, mounts))
        self._mounts = mounts

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> JointAngles:  # noqa: ARG002
        """Returns the present angles (S,) rad and rates (S,) rad/s."""
        now = np.array([nodding_angle_at(mount, time_ns) for mount in self._mounts])
        soon = np.array([nodding_angle_at(m, time_ns + _DIFFERENCE_NS) for m in self._mounts])
        rate = (soon - now) / (_DIFFERENCE_NS / NS_PER_S)
        return JointAngles(self.sensors, time_ns, read_only(now), read_only(rate))
