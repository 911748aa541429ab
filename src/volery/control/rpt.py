"""Robust and perfect tracking: gains of the outer loop from its poles.

For each axis the model of the vehicle is p'' = a. With a reference (p_r, v_r, a_r) the law

    a = a_r + Fv (v_r - v) + Fp (p_r - p) + Fi integral(p_r - p)

gives the closed loop (e^2 s^2 + 2 zeta wn e s + wn^2)(e s + ki) / e^3: poles of natural frequency
wn / e and damping zeta, and one at -ki / e for steady disturbances. The smaller e, the tighter the
tracking; the bandwidth of the loop below bounds it (G. Cai, B. M. Chen, T. H. Lee, "Unmanned
Rotorcraft Systems", 2011). `outer_loop.track` is the law itself, with its limits.
"""

from __future__ import annotations

from typing import NamedTuple

from volery.vehicle.airframe import TrackingPoles

_FRACTION_OF_ATTITUDE = 0.25
"""wn / e of the horizontal axes, fraction of the attitude loop's bandwidth: a third to a fifth is
the rule."""
_FRACTION_OF_RATE = 0.14
"""wn / e of height, fraction of the rate loop's bandwidth. Modelling choice: the rotors alone would
allow more, but thrust acts through the attitude, and so does noise of the estimate."""
_DAMPING = 0.9
"""Damping zeta (modelling choice); the loop below reduces it."""
_INTEGRAL_FRACTION = 0.25
"""ki, fraction of wn (modelling choice): steady disturbances are compensated four times slower."""


class TrackingGains(NamedTuple):
    """Gains of one axis group."""

    position: float
    """Fp, 1/s^2."""
    velocity: float
    """Fv, 1/s."""
    integral: float
    """Fi, 1/s^3."""


def tracking_gains(wn: float, zeta: float, ki: float, epsilon: float) -> TrackingGains:
    """Returns gains for the poles of p'' = a by the formula above; ki = 0: no integral."""
    return TrackingGains(
        (wn * wn + 2.0 * zeta * wn * ki) / epsilon**2,
        (2.0 * zeta * wn + ki) / epsilon,
        ki * wn * wn / epsilon**3,
    )


def level_gains(wish: TrackingPoles, attitude: float) -> TrackingGains:
    """Returns gains of both horizontal axes over an attitude loop of bandwidth `attitude` rad/s."""
    return _gains(wish, _FRACTION_OF_ATTITUDE * attitude)


def height_gains(wish: TrackingPoles, rate: float) -> TrackingGains:
    """Returns gains of the vertical axis over a rate loop of bandwidth `rate` rad/s."""
    return _gains(wish, _FRACTION_OF_RATE * rate)


def _gains(wish: TrackingPoles, bandwidth: float) -> TrackingGains:
    wn = bandwidth * wish.epsilon if wish.wn is None else wish.wn
    ki = _INTEGRAL_FRACTION * wn if wish.ki is None else wish.ki
    return tracking_gains(wn, _DAMPING if wish.zeta is None else wish.zeta, ki, wish.epsilon)
