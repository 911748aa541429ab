"""Battery monitors: exact voltage, current and charge."""

from __future__ import annotations

import numpy as np

from volery.control.fleet import Fleet
from volery.core.arrays import read_only
from volery.core.errors import DataFileError
from volery.sensors.bank import Memoryless, SensorGroup
from volery.sensors.samples import BatterySamples


class BatteryBank(Memoryless):
    """All battery monitors of one rate and phase.

    Raises `DataFileError` if an airframe has no battery.
    """

    name = "battery"
    lag_ns = 0

    def __init__(self, group: SensorGroup, fleet: Fleet) -> None:
        super().__init__(group)
        packs = []
        for row in self._rows:
            airframe = fleet.airframes[row]
            if airframe.battery is None:
                raise DataFileError(
                    f"airframe {airframe.name} has no battery to monitor; its file needs a "
                    "[battery] table"
                )
            packs.append(airframe.battery)
        self._capacity_ah = read_only(np.array([pack.capacity_ah for pack in packs]))
        self._cells = read_only(np.array([pack.cells for pack in packs]))

    def sample(self, k: int, time_ns: int, fleet: Fleet) -> BatterySamples:  # noqa: ARG002
        """Returns voltages, currents and charges (S,) of measurement `k`; see `Bank`."""
        state, rows = fleet.state, self._rows
        return BatterySamples(
            self.sensors,
            time_ns,
            read_only(state.battery_voltage[rows]),
            read_only(state.battery_current[rows]),
            read_only(state.battery_charge[rows]),
            self._capacity_ah,
            self._cells,
            read_only(state.battery_level[rows]),
        )
