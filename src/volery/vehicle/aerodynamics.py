"""Forces of the air: rotors after RotorS and PX4, quadratic drag of the body.

A rotor at speed w whose hub moves at v through the air, v_par along its axis and v_perp across:

    thrust          F = kF w^2 clamp(1 - |v_par| / 25, 0, 1)      along the axis
    in-plane drag   H = -w c_d v_perp                             at the hub
    reaction torque -s F kM                                       about the axis
    rolling moment  -w s c_r v_perp

with s = +1 for a rotor that turns counter-clockwise seen from above. Its speed follows the command
as a first-order lag, faster up than down, solved exactly. Source of form and constants: the motor
model plugins of RotorS (ETH Zurich) and PX4's Gazebo Classic simulation. kF is each rotor's own
(`BODY`'s rotor_lift): wear reduces it, the ground increases it (`vehicle.ground_effect`).

The body's drag along each of its axes is -1/2 rho C_d A |v| v_i, v relative to the surrounding air
(modelling choice; the areas are the airframe's).
"""

from __future__ import annotations

import math
from typing import Any

from volery.core.simd import (
    LANES,
    lanes_at,
    magnitudes,
    no_lanes,
    not_negative,
    put_lanes,
    totals,
    where_negative,
)
from volery.vehicle.compiled import inner_kernel

INFLOW_SPEED = 25.0
"""Speed along the axis at which a rotor's thrust vanishes, m/s (RotorS, PX4)."""
_INVERSE_INFLOW = 1.0 / INFLOW_SPEED


@inner_kernel
def air_wrench(
    body: Any,
    plant: Any,
    command: Any,
    vx: float,
    vy: float,
    vz: float,
    ox: float,
    oy: float,
    oz: float,
) -> tuple[float, float, float, float, float, float]:
    """Returns force and torque of the air at mid-step, FLU; advances rotor speeds by a step.

    body: a `BODY`. plant: a `PLANT`. command: a record with `rotor_reference`, rad/s. (vx, vy, vz)
    m/s: velocity of the centre of mass through the air, (ox, oy, oz) rad/s: body rates, both FLU
    and at mid-step. Returns (fx, fy, fz, tx, ty, tz) in N and N m.
    """
    if plant.upright and not body.altered:
        fx, fy, fz, tx, ty, tz = upright_rotors(body, plant, command, vx, vy, vz, ox, oy, oz)
    else:
        fx, fy, fz, tx, ty, tz = leaning_rotors(body, plant, command, vx, vy, vz, ox, oy, oz)
    speed = math.sqrt(vx * vx + vy * vy + vz * vz)
    fx -= plant.drag[0] * speed * vx
    fy -= plant.drag[1] * speed * vy
    fz -= plant.drag[2] * speed * vz
    return fx, fy, fz, tx, ty, tz


@inner_kernel
def _speed_at_mid_step(body: Any, plant: Any, wanted: float, r: int) -> float:
    """Returns the speed of rotor `r` at mid-step, rad/s; advances its speed in `body` by a step."""
    lead = body.rotor_speed[r] - wanted
    rising = lead < 0.0
    body.rotor_speed[r] = wanted + lead * (plant.rise[r] if rising else plant.fall[r])
    half: float = wanted + lead * (plant.rise_half[r] if rising else plant.fall_half[r])
    return half


@inner_kernel
def _speeds_at_mid_step(body: Any, plant: Any, command: Any, first: int) -> Any:
    """Returns `_speed_at_mid_step` of the rotors of `lanes_at(..., first)`, none of them failed."""
    wanted = lanes_at(command.rotor_reference, first)
    lead = lanes_at(body.rotor_speed, first) - wanted
    rise, fall = lanes_at(plant.rise, first), lanes_at(plant.fall, first)
    rise_half, fall_half = lanes_at(plant.rise_half, first), lanes_at(plant.fall_half, first)
    put_lanes(body.rotor_speed, first, wanted + lead * where_negative(lead, rise, fall))
    return wanted + lead * where_negative(lead, rise_half, fall_half)


@inner_kernel
def leaning_rotors(
    body: Any,
    plant: Any,
    command: Any,
    vx: float,
    vy: float,
    vz: float,
    ox: float,
    oy: float,
    oz: float,
) -> tuple[float, float, float, float, float, float]:
    """Returns force and torque of rotors with any positions, axes and thrust constants."""
    loss, roll = plant.rotor_drag, plant.rolling
    fx = fy = fz = tx = ty = tz = 0.0
    for r in range(plant.rotors):
        lift = body.rotor_lift[r]
        wanted = command.rotor_reference[r] if lift > 0.0 else 0.0  # a failed motor stops
        w = _speed_at_mid_step(body, plant, wanted, r)
        px, py, pz = plant.rotor_x[r], plant.rotor_y[r], plant.rotor_z[r]
        ax, ay, az = plant.rotor_axis[r, 0], plant.rotor_axis[r, 1], plant.rotor_axis[r, 2]
        hx = vx + oy * pz - oz * py
        hy = vy + oz * px - ox * pz
        hz = vz + ox * py - oy * px
        along = hx * ax + hy * ay + hz * az
        hx -= along * ax
        hy -= along * ay
        hz -= along * az
        thrust = lift * w * w * max(1.0 - abs(along) * _INVERSE_INFLOW, 0.0)
        gx = thrust * ax - loss * w * hx
        gy = thrust * ay - loss * w * hy
        gz = thrust * az - loss * w * hz
        reaction = plant.reaction[r] * thrust
        rolling = plant.spin[r] * roll * w
        fx += gx
        fy += gy
        fz += gz
        tx += py * gz - pz * gy - reaction * ax - rolling * hx
        ty += pz * gx - px * gz - reaction * ay - rolling * hy
        tz += px * gy - py * gx - reaction * az - rolling * hz
    return fx, fy, fz, tx, ty, tz


@inner_kernel
def upright_rotors(
    body: Any,
    plant: Any,
    command: Any,
    vx: float,
    vy: float,
    vz: float,
    ox: float,
    oy: float,
    oz: float,
) -> tuple[float, float, float, float, float, float]:
    """Returns `leaning_rotors` for axes along body z, hubs at one height, unaltered thrusts.

    Computes two rotors at once; a missing one is at rest at the origin.
    """
    constant, loss, roll = plant.thrust_constant, plant.rotor_drag, plant.rolling
    pz = plant.rotor_z[0]
    ux, uy = vx + oy * pz, vy - ox * pz  # across, at the centre of the rotors' plane
    fx = fy = lift = tx = ty = tz = no_lanes()
    for first in range(0, plant.rotors, LANES):
        w = _speeds_at_mid_step(body, plant, command, first)
        px, py = lanes_at(plant.rotor_x, first), lanes_at(plant.rotor_y, first)
        along = (py * ox - px * oy) + vz
        thrust = constant * w * w * not_negative(1.0 - magnitudes(along) * _INVERSE_INFLOW)
        hx, hy = ux - py * oz, uy + px * oz
        drag = loss * w
        gx, gy = drag * hx, drag * hy
        rolling = lanes_at(plant.spin, first) * (roll * w)
        fx -= gx
        fy -= gy
        lift += thrust
        tx += py * thrust - rolling * hx
        ty -= px * thrust + rolling * hy
        tz += py * gx - px * gy - lanes_at(plant.reaction, first) * thrust
    force_x, force_y = totals(fx, fy)
    force_z, torque_z = totals(lift, tz)
    torque_x, torque_y = totals(tx, ty)
    return (
        force_x,
        force_y,
        force_z,
        torque_x - pz * force_y,
        torque_y + pz * force_x,
        torque_z,
    )
