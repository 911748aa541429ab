"""The built-in metrics of a study. Their parameters name attributes of `FinishedRun`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from volery.core.errors import VoleryError
from volery.results import FlightResult
from volery.results.alignment import at_times, ate_rmse_m, common_times
from volery.vehicle.airframe import Airframe
from volery.vehicle.battery import Battery, open_circuit_voltage
from volery.verdicts.measures import area_m2
from volery.verdicts.observing import Estimate, Estimates
from volery.verdicts.verdict import Verdict

_WH_POINTS = 201
_MIN_POSES = 3


def success(flight: FlightResult) -> float:
    """Returns 1 if no UAV hit anything and none crashed, else 0."""
    return float(not flight.contacts and not flight.crashed.any())


def collisions(flight: FlightResult) -> float:
    """Returns the number of collisions with trees, solids and UAVs, and of impacts."""
    return float(len(flight.contacts))


def crashed(flight: FlightResult) -> float:
    """Returns the number of UAVs that crashed."""
    return float(flight.crashed.sum())


def distance_m(flight: FlightResult) -> float:
    """Returns the mean length of the UAVs' paths, m."""
    return float(flight.distance_m.mean())


def time_s(flight: FlightResult) -> float:
    """Returns the simulated time of the flight, s."""
    return flight.duration_s


def max_speed_m_s(flight: FlightResult) -> float:
    """Returns the max speed of any UAV, m/s."""
    return float(np.nanmax(flight.speed_m_s, initial=0.0))


def clearance(clearance: Callable[[], float]) -> float:
    """Returns the min distance to trees and solids, m, at most 10 m."""
    return clearance()


def separation_m(flight: FlightResult) -> float:
    """Returns the min distance between two UAVs, m; nan for one UAV."""
    nearest = float(flight.separation_m.min(initial=np.inf))
    return nearest if np.isfinite(nearest) else np.nan


def energy_wh(flight: FlightResult, airframes: Mapping[str, Airframe]) -> float:
    """Returns the energy that all batteries gave, W h; nan if no airframe has a battery."""
    total, batteries = 0.0, 0
    for row, name in enumerate(flight.uavs):
        battery = airframes[name].battery
        charges = flight.battery_charge[row]
        charges = charges[np.isfinite(charges)]
        if battery is not None and len(charges):
            batteries += 1
            total += _energy_wh(battery, float(charges[-1]), float(charges[0]))
    return total if batteries else np.nan


def _energy_wh(battery: Battery, low: float, high: float) -> float:
    """Returns the energy of a battery between two charges: voltage times capacity, integrated."""
    charges = np.linspace(low, high, _WH_POINTS)
    voltages = np.array([open_circuit_voltage(battery, charge) for charge in charges.tolist()])
    return battery.capacity_ah * float(np.trapezoid(voltages, charges))


def ate_m(flight: FlightResult, estimates: Estimates) -> float:
    """Returns the max over the UAVs of the RMSE of estimated positions after alignment, m.

    Raises `VoleryError` if no UAV estimates its pose.
    """
    if not estimates:
        raise VoleryError(
            "metric 'ate_m': no UAV publishes slam/pose, slam/odom or odom; add a SLAM node"
        )
    errors = [_ate(flight, name, estimate) for name, estimate in estimates.items()]
    return float(np.nanmax(errors)) if np.isfinite(errors).any() else np.nan


def _ate(flight: FlightResult, name: str, estimate: Estimate) -> float:
    inside = common_times(estimate.times_s, flight.times_s)
    if inside.sum() < _MIN_POSES:
        return np.nan
    truth = at_times(flight.times_s, flight[name].position_map, estimate.times_s[inside])
    return ate_rmse_m(estimate.position[inside], truth)


def area(flight: FlightResult, radius_m: float = 2.0) -> float:
    """Returns the ground area, m2, within `radius_m` of any UAV's path, in cells of 0.5 m."""
    return area_m2(flight.position_map, radius_m)


def real_time_factor(flight: FlightResult, wall_s: float) -> float:
    """Returns the simulated time per wall time; it differs when a run is repeated."""
    return flight.duration_s / wall_s if wall_s > 0.0 else np.nan


def expectations(verdicts: Sequence[Verdict]) -> dict[str, float]:
    """Returns whether the flight passes all expectations, and the margin of each by its name.

    Raises `VoleryError` for a scenario without expectations.
    """
    if not verdicts:
        raise VoleryError("metric 'expectations': the scenario has no [[expect]]")
    margins = {verdict.name: verdict.margin for verdict in verdicts}
    return {"passed": float(all(verdict.is_passed for verdict in verdicts)), **margins}


FUNCTIONS: dict[str, Callable[..., float | dict[str, float]]] = {
    "success": success,
    "collisions": collisions,
    "crashed": crashed,
    "distance_m": distance_m,
    "time_s": time_s,
    "max_speed_m_s": max_speed_m_s,
    "clearance_m": clearance,
    "separation_m": separation_m,
    "energy_wh": energy_wh,
    "ate_m": ate_m,
    "area_m2": area,
    "real_time_factor": real_time_factor,
    "expectations": expectations,
}
"""Built-in metrics by name."""
