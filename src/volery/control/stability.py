"""Numerical stability of a vehicle's motion with a physics step: stiffness of its terms.

Rotors and identified loops are stepped by their exact solutions, whatever their times. Forces of
the air are integrated explicitly, once a step, at velocities extrapolated to mid-step from the last
acceleration. A force that removes a fraction z of the motion in a step, v' = -z/dt v, then maps
(v, dt a) by [[1 - z, -z/2], [-z, -z/2]], whose eigenvalues lie in the unit circle for z < 1:

    determinant -z/2, trace 1 - 3z/2;  |trace| < 1 + determinant  <=>  0 < z < 1
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from volery.core.errors import DataFileError
from volery.scenario.wind import MAX_WIND_M_S
from volery.vehicle.aerodynamics import INFLOW_SPEED
from volery.vehicle.airframe import Airframe
from volery.vehicle.identified import IdentifiedModel
from volery.vehicle.kinematic import Kinematic
from volery.vehicle.plant import AIR_DENSITY
from volery.vehicle.plant_types import Plant

STABLE_BELOW = 1.0


class StabilityTerm(NamedTuple):
    """A term of the motion that is stepped explicitly."""

    key: str
    """The number of the data file that determines it."""
    owner: str
    """The data file's subject, such as `airframe 'f450'`."""
    fraction: float
    """Fraction of the motion that the term removes in a step."""


def terms_of(airframe: Airframe, plant: Plant, dt: float, speed_m_s: float) -> list[StabilityTerm]:
    """Returns the explicit terms of a vehicle at a speed through the air, the stiffest first."""
    if isinstance(plant, Kinematic):
        return []
    if isinstance(plant, IdentifiedModel):
        found = {"drag_1_s": max(plant.drag_1_s)}
        owner = f"identified model '{plant.name}'"
    else:
        found, owner = _rigid_body(airframe, speed_m_s), f"airframe '{airframe.name}'"
    terms = [StabilityTerm(key, owner, rate * dt) for key, rate in found.items()]
    return sorted(terms, key=lambda term: -term.fraction)


def check_stability(airframe: Airframe, plant: Plant, dt: float) -> None:
    """Raises `DataFileError` if a term is too stiff for a step of `dt` s at usual speeds."""
    for term in terms_of(airframe, plant, dt, airframe.limits.speed_m_s + MAX_WIND_M_S):
        if not term.fraction < STABLE_BELOW:
            raise DataFileError(
                f"{term.owner}: {term.key} cannot be computed with a physics step of "
                f"{1e3 * dt:g} ms: it removes {term.fraction:.3g} of the motion in each step, and "
                f"less than {STABLE_BELOW:g} is stable; use a smaller {term.key} or, if it "
                "is right, a higher physics.rate_hz"
            )


def _rigid_body(airframe: Airframe, speed_m_s: float) -> dict[str, float]:
    """Returns the rates, 1/s, at which each number brakes the motion."""
    body, rotors = airframe.body, airframe.rotors
    count, full = len(rotors.places), rotors.max_speed_rad_s
    arms = np.array([math.hypot(*rotor.position_m) for rotor in rotors.places])
    min_inertia = min(body.inertia_kg_m2)
    inflow = airframe.max_rotor_thrust / INFLOW_SPEED  # N s/m, of one rotor
    drag = rotors.drag_n_s2_m * full
    squares, lengths = float((arms**2).sum()), float(arms.sum())
    return {
        "body.drag_area_m2": AIR_DENSITY * max(body.drag_area_m2) * speed_m_s / body.mass_kg,
        "rotors.drag_n_s2_m": max(drag * count / body.mass_kg, drag * squares / min_inertia),
        "rotors.thrust_n_s2": max(inflow * count / body.mass_kg, inflow * squares / min_inertia),
        "rotors.rolling_n_s2": rotors.rolling_n_s2 * full * lengths / min_inertia,
    }
