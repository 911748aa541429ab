"""Domain randomization: parameters of environments that each episode draws anew."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.learning.flight import Flight
from volery.runtime.environment_parameters import EnvironmentParameters


@dataclass(frozen=True)
class Variation:
    """A parameter of environments that each episode draws."""

    name: str
    unit: str
    draw: Callable[[Flight, NDArray[np.int64]], Array]
    """Draws (R, n, size) numbers for the environments (R,); their n UAVs may have equal ones."""
    size: int = 1
    apply: Callable[[Flight, Array], EnvironmentParameters] | None = None
    """Returns the simulation's parameters of numbers (R, n, size); None: they change nothing that
    is simulated, but `flight.varied[name]` (K, n, size) has them."""


def wind(low_m_s: float, high_m_s: float) -> Variation:
    """Returns a steady horizontal wind: speeds between two bounds, in any direction."""

    def draw(flight: Flight, envs: NDArray[np.int64]) -> Array:
        speed = flight.draws.uniform(envs, low_m_s, high_m_s)
        angle = flight.draws.uniform(envs, -math.pi, math.pi)
        velocity = np.stack([speed * np.cos(angle), speed * np.sin(angle), 0.0 * speed], axis=-1)
        return _for_all(flight, velocity)

    return Variation("wind", "m/s", draw, 3, lambda _, v: EnvironmentParameters(wind_map=v))


def turbulence(low_m_s: float, high_m_s: float) -> Variation:
    """Returns the strength of Dryden turbulence: mean wind at 20 ft, 7.7 m/s is light."""
    return Variation(
        "turbulence",
        "m/s",
        lambda f, envs: _for_all(f, f.draws.uniform(envs, low_m_s, high_m_s, (1,))),
        1,
        lambda _, v: EnvironmentParameters(turbulence_m_s=v[..., 0]),
    )


def mass(low: float, high: float) -> Variation:
    """Returns factors of the mass. Controllers do not know them; neither do the next ones."""
    return Variation(
        "mass",
        "1",
        _factors(low, high, 1),
        1,
        lambda f, v: EnvironmentParameters(mass_kg=f.airframe.body.mass_kg * v[..., 0]),
    )


def inertia(low: float, high: float) -> Variation:
    """Returns factors of the moments of inertia about the three axes."""
    return Variation(
        "inertia",
        "1",
        _factors(low, high, 3),
        3,
        lambda f, v: EnvironmentParameters(
            inertia_kg_m2=np.array(f.airframe.body.inertia_kg_m2) * v
        ),
    )


def rotor_thrust(low: float, high: float, *, rotors: int = 4) -> Variation:
    """Returns the thrust of each rotor as a fraction, at most 1, of a new one's: worn blades."""
    return Variation(
        "rotor_thrust",
        "1",
        _factors(low, high, rotors),
        rotors,
        lambda _, v: EnvironmentParameters(rotor_thrust=v),
    )


def motor_delay(low: float, high: float) -> Variation:
    """Returns factors of the time constants of all motors of a UAV."""
    return Variation(
        "motor_delay",
        "1",
        _factors(low, high, 1),
        1,
        lambda _, v: EnvironmentParameters(motor_delay=v),
    )


NOISE_SCALE = "noise_scale"
"""Name of the variation that multiplies the noise and bias of all observations."""


def noise_scale(low: float, high: float) -> Variation:
    """Returns factors of the noise and bias of all observations."""
    return Variation(NOISE_SCALE, "1", _factors(low, high, 1))


def _factors(low: float, high: float, size: int) -> Callable[[Flight, NDArray[np.int64]], Array]:
    """Returns a function that draws factors (R, n, size) of each UAV."""
    return lambda flight, envs: flight.draws.uniform(envs, low, high, (flight.num_uavs, size))


def _for_all(flight: Flight, numbers: Array) -> Array:
    """Returns numbers (R, size) of environments for each of their UAVs, (R, n, size)."""
    return np.repeat(numbers[:, None], flight.num_uavs, axis=1)
