"""Drag of an airframe in moving air: acceleration and steady tilt.

Figures of a whole vehicle, for the design of controllers and for comparison with published flights
(docs/models.md, drag). `vehicle.aerodynamics` computes the forces.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from volery.vehicle.airframe import GRAVITY, Airframe, hover_thrusts
from volery.vehicle.plant import AIR_DENSITY


def hover_rotor_drags(airframe: Airframe) -> NDArray[np.float64]:
    """Returns each rotor's in-plane drag (R,) at hover speed, N s/m."""
    speeds = np.sqrt(hover_thrusts(airframe) / airframe.rotors.thrust_n_s2)
    return np.asarray(airframe.rotors.drag_n_s2_m * speeds)


def drag_acceleration(airframe: Airframe, speed_m_s: float) -> float:
    """Returns the drag of rotors and body over mass in air that flows along x, m/s^2.

    The vehicle is level and its rotors turn at hover speed.
    """
    rotors = float(hover_rotor_drags(airframe).sum()) * speed_m_s
    body = 0.5 * AIR_DENSITY * airframe.body.drag_area_m2[0] * speed_m_s**2
    return (rotors + body) / airframe.body.mass_kg


def steady_tilt(airframe: Airframe, speed_m_s: float) -> float:
    """Returns the tilt, rad, that holds the vehicle in a wind, or at that speed in a calm.

    From `drag_acceleration`; the higher rotor speed of a tilted vehicle is left out, 2 degrees at
    30 degrees.
    """
    return math.atan(drag_acceleration(airframe, speed_m_s) / GRAVITY)
