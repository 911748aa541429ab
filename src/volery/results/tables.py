"""Returns the samples and the events of a flight as tables of pandas."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.control.flight_modes import FlightMode
from volery.core.clock import s_from_ns
from volery.core.data_frames import data_frame
from volery.engine.events import Event
from volery.results.flight_states import FlightStates

if TYPE_CHECKING:
    import pandas

_AXES = {
    "position_map": ("x_m", "y_m", "z_m"),
    "velocity_map": ("vx_m_s", "vy_m_s", "vz_m_s"),
    "attitude": ("qx", "qy", "qz", "qw"),
    "omega_body": ("wx_rad_s", "wy_rad_s", "wz_rad_s"),
}


def flight_table(result: FlightStates) -> pandas.DataFrame:
    """Returns the samples of a flight, UAV by UAV; see `FlightResult.to_pandas`."""
    n, t = len(result), len(result.times_s)
    exists = (result.mode >= 0).ravel()
    columns: dict[str, Any] = {
        "time_s": np.tile(result.times_s, n)[exists],
        "uav": np.repeat(np.array(result.uavs, dtype=object), t)[exists],
    }
    for field, names in _AXES.items():
        rows = getattr(result, field).reshape(n * t, len(names))[exists]
        columns |= {name: rows[:, k] for k, name in enumerate(names)}
    columns["battery_charge"] = result.battery_charge.ravel()[exists]
    names_of_modes = np.array([mode.name for mode in FlightMode], dtype=object)
    columns["mode"] = names_of_modes[result.mode.ravel()[exists]]
    return data_frame(columns)


def events_table(events: Sequence[Event]) -> pandas.DataFrame:
    """Returns events as a table; see `FlightResult.events_to_pandas`."""
    position = np.array([event.position_map for event in events], np.float64).reshape(-1, 3)
    columns = {
        "time_s": [s_from_ns(event.time_ns) for event in events],
        "uav": [event.uav for event in events],
        "kind": [str(event.kind) for event in events],
        "partner": [event.partner for event in events],
        "detail": [event.detail for event in events],
        "speed_m_s": [event.speed_m_s for event in events],
        "x_m": position[:, 0],
        "y_m": position[:, 1],
        "z_m": position[:, 2],
    }
    return data_frame(columns, "events_to_pandas()")
