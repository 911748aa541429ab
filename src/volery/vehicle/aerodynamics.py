"""Forces of the air: rotors after RotorS and PX4, quadratic drag of the body.

A rotor at speed w whose hub moves at v through the air, v_par along its axis and v_perp across:

    thrust          F = kF w^2 clamp(1 - |v_par| / 25, 0, 1)      along the axis
    in-plane drag   H = -w c_d v_perp                             at the hub
    reaction torque -s F kM                                       about the axis
    rolling moment  -w s c_r v_perp

with s = +1 for a rotor that turns counter-clockwise seen from above. Its speed follows the command
as a first-order lag, faster up than down, solved exactly. Source of form and constants: the motor
model plugins of RotorS (ETH Zurich) and PX4's Gazebo Classic simulation. kF is each rotor's own
(`BODY`'s rotor_lift): wear lowers it, the ground raises it (`vehicle.ground_effect`).

The body's drag along each of its axes is -1/2 rho C_d A |v| v_i, v relative to the air around
(modelling choice; the areas are the airframe's).
"""

from __future__ import annotations

import math
from typing import Any

from volery.vehicle.compiled import inner_kernel

INFLOW_SPEED = 25.0
"""m/s along the axis at which a rotor's thrust is gone (RotorS, PX4)."""
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
    """Force and torque of the air at mid-step, FLU; the rotors' speeds move on by a whole step.

    body: a `BODY`. plant: a `PLANT`. command: a record with `rotor_reference`, rad/s.
    (vx, vy, vz) m/s: velocity of the centre of mass through the air, (ox, oy, oz) rad/s: body
    rates, both FLU and at mid-step.
    Returns (fx, fy, fz, tx, ty, tz) in N and N m.
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
    """Speed of rotor `r` half a step on, rad/s; its speed in `body` moves on by a whole step."""
    lead = body.rotor_speed[r] - wanted
    rising = lead < 0.0
    body.rotor_speed[r] = wanted + lead * (plant.rise[r] if rising else plant.fall[r])
    half: float = wanted + lead * (plant.rise_half[r] if rising else plant.fall_half[r])
    return half


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
    """Force and torque of rotors with any places, axes and thrust constants."""
    loss, roll = plant.rotor_drag, plant.rolling
    fx = fy = fz = tx = ty = tz = 0.0
    for r in range(plant.rotors):
        lift = body.rotor_lift[r]
        wanted = command.rotor_reference[r] if lift > 0.0 else 0.0  # a lost motor stops
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
    """`leaning_rotors` for axes along the body's z, hubs at one height and thrusts unaltered.

    Drag and rolling moment are linear in the hubs' velocities, so their sums need only the moments
    of the speeds over the rotors: w, w x, w y, w (x^2 + y^2), and with the spins s w, s w x, s w y.
    """
    constant = plant.thrust_constant
    w0 = wx = wy = wrr = q0 = qx = qy = 0.0
    lift = lift_x = lift_y = twist = 0.0
    for r in range(plant.rotors):
        w = _speed_at_mid_step(body, plant, command.rotor_reference[r], r)
        px, py = plant.rotor_x[r], plant.rotor_y[r]
        along = vz + ox * py - oy * px
        thrust = constant * w * w * max(1.0 - abs(along) * _INVERSE_INFLOW, 0.0)
        q = plant.spin[r] * w
        w0 += w
        wx += w * px
        wy += w * py
        wrr += w * plant.rotor_arm_square[r]
        q0 += q
        qx += q * px
        qy += q * py
        lift += thrust
        lift_x += thrust * px
        lift_y += thrust * py
        twist += thrust * plant.reaction[r]
    loss, roll, pz = plant.rotor_drag, plant.rolling, plant.rotor_z[0]
    ux, uy = vx + oy * pz, vy - ox * pz  # across, at the middle of the rotors' plane
    fx = -loss * (ux * w0 - oz * wy)
    fy = -loss * (uy * w0 + oz * wx)
    tx = lift_y - pz * fy - roll * (ux * q0 - oz * qy)
    ty = pz * fx - lift_x - roll * (uy * q0 + oz * qx)
    tz = -loss * (uy * wx + oz * wrr - ux * wy) - twist
    return fx, fy, lift, tx, ty, tz
