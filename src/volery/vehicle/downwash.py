"""Downwash: the jet of air under a UAV, and what it does to UAVs below.

Momentum theory gives the rotors' induced speed and the speed of the air far below a disc:

    v_i = sqrt(T / (2 rho A))        w = 2 v_i

with T the thrust and A the area of all rotors, pi R^2. The jet hangs straight down, spreads and
keeps its momentum; at depth s below the rotors and r off its middle

    w(s, r) = v_i (1 + s / sqrt(s^2 + R^2)) (R / b) exp(-r^2 / b^2)        b = R + 0.1 s

which is v_i at the disc (an actuator disc's inflow), and a Gaussian of momentum flux
rho w_0^2 pi b^2 / 2 = T far below. It ends smoothly at 2.5 b and fades out over the last third of
100 R (modelling choices, as are the straight hang and the rate of spread). For a UAV below it is
moving air: its rotors lose thrust and its body is dragged down.

The search for neighbours is by conservative advancement, as for contacts: each UAV carries a
distance that it may fly before it can meet a jet or reach another UAV with its own; for each pair
the two distances never exceed the gap. Only who has used his up looks around, along the order of
the UAVs in x. So fleets without UAVs over each other cost next to nothing, and the sum of jets,
taken in the order of places, depends on places alone.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.vehicle.compiled import inner_kernel
from volery.vehicle.plant import AIR_DENSITY

SPREAD = 0.1
"""Growth of the jet's radius with depth."""
DEPTH = 100.0
"""Jet radii R after which the jet is gone."""
EDGE = 2.5
"""Radii b after which the jet has ended sideways."""
_FADE_FROM = 2.0 / 3.0
_AT_EDGE = math.exp(-EDGE * EDGE)
_INVERSE_SLANT = 1.0 / math.sqrt(1.0 + (EDGE * SPREAD) ** 2)
_LOOK_BEYOND = 4.0
"""m beyond the widest jet that a look reaches."""


@inner_kernel
def add_downwash(uavs: NDArray[np.void], models: NDArray[np.void], order: Any) -> None:
    """Add the jets of all UAVs to the `air_velocity_map` of those in them.

    order: (N,) whole numbers, any order of the rows; left sorted by place.
    """
    count = uavs.shape[0]
    waiting = False
    for i in range(count):
        waiting = waiting or uavs[i].body.downwash_budget <= 0.0
    if not waiting:
        return
    _sort_by_place(uavs, order)
    reach = 0.0
    for m in range(models.shape[0]):
        radius = models[m].plant.jet_radius
        reach = max(reach, EDGE * (1.0 + SPREAD * DEPTH) * radius)
    reach += _LOOK_BEYOND
    for k in range(count):
        if uavs[order[k]].body.downwash_budget <= 0.0:
            _refill_budgets(uavs, models, order, k, reach)
    for k in range(count):
        body = uavs[order[k]].body
        if body.downwash_budget <= 0.0 and not body.asleep:
            body.air_velocity_map[2] -= _jets_over(uavs, models, order, k, reach)


@inner_kernel
def _refill_budgets(uavs: Any, models: Any, order: Any, k: int, reach: float) -> None:
    """Share the gap to each neighbour of UAV `order[k]` between the two of them."""
    i = order[k]
    radius = models[uavs[i].model].plant.jet_radius
    budget = 0.5 * _LOOK_BEYOND * _INVERSE_SLANT
    first, last = _window(uavs, order, k, reach)
    for n in range(first, last):
        j = order[n]
        if j == i:
            continue
        r, s = _offset(uavs[i].body, uavs[j].body)
        other = models[uavs[j].model].plant.jet_radius
        half = 0.5 * min(_gap(r, s, other), _gap(r, -s, radius))
        budget = min(budget, half)
        uavs[j].body.downwash_budget = min(uavs[j].body.downwash_budget, half)
    uavs[i].body.downwash_budget = budget


@inner_kernel
def _jets_over(uavs: Any, models: Any, order: Any, k: int, reach: float) -> float:
    """Speed of the air downwards at UAV `order[k]`, m/s, summed in the order of places."""
    i = order[k]
    speed = 0.0
    first, last = _window(uavs, order, k, reach)
    for n in range(first, last):
        j = order[n]
        r, s = _offset(uavs[i].body, uavs[j].body)
        plant = models[uavs[j].model].plant
        if j != i and _gap(r, s, plant.jet_radius) < 0.0:
            thrust = 0.0
            for rotor in range(plant.rotors):
                w = uavs[j].body.rotor_speed[rotor]
                thrust += uavs[j].body.rotor_lift[rotor] * w * w
            speed += jet_speed(thrust, plant.jet_radius, r, s)
    return speed


@inner_kernel
def jet_speed(thrust: float, radius: float, r: float, s: float) -> float:
    """Speed (m/s) of the jet of `thrust` N from a disc of `radius` m, r off and s below it, m."""
    if s <= 0.0 or s >= DEPTH * radius:
        return 0.0
    wide = radius + SPREAD * s
    shape = math.exp(-(r * r) / (wide * wide)) - _AT_EDGE
    if shape <= 0.0:
        return 0.0
    induced = math.sqrt(thrust / (2.0 * AIR_DENSITY * math.pi)) / radius
    speed = induced * (1.0 + s / math.sqrt(s * s + radius * radius)) * (radius / wide) * shape
    end = (s / (DEPTH * radius) - _FADE_FROM) * (1.0 / (1.0 - _FADE_FROM))
    if end > 0.0:
        speed *= 1.0 - end * end * (3.0 - 2.0 * end)
    return speed


@inner_kernel
def _gap(r: float, s: float, radius: float) -> float:
    """No more than the distance to the jet of a disc of `radius`, from r off and s below it.

    Negative inside. It changes by no more than the way moved.
    """
    depth = DEPTH * radius
    wide = EDGE * (radius + SPREAD * min(max(s, 0.0), depth))
    return max((r - wide) * _INVERSE_SLANT, -s, s - depth)


@inner_kernel
def _offset(body: Any, other: Any) -> tuple[float, float]:
    """How far `body` is off the vertical through `other`, and how far below it; m."""
    dx = body.position_map[0] - other.position_map[0]
    dy = body.position_map[1] - other.position_map[1]
    return math.sqrt(dx * dx + dy * dy), other.position_map[2] - body.position_map[2]


@inner_kernel
def _window(uavs: Any, order: Any, k: int, reach: float) -> tuple[int, int]:
    """Range of the ordered UAVs in the same copy within `reach` m in x of number `k`."""
    copy, x = uavs[order[k]].copy, uavs[order[k]].body.position_map[0]
    first = k
    while first > 0:
        other = uavs[order[first - 1]]
        if other.copy != copy or x - other.body.position_map[0] > reach:
            break
        first -= 1
    last = k + 1
    while last < uavs.shape[0]:
        other = uavs[order[last]]
        if other.copy != copy or other.body.position_map[0] - x > reach:
            break
        last += 1
    return first, last


@inner_kernel
def _sort_by_place(uavs: Any, order: Any) -> None:
    """Sort by copy, x, y, z. By insertion: from one look to the next little changes."""
    for k in range(1, uavs.shape[0]):
        i = order[k]
        n = k
        while n > 0 and _before(uavs[i], uavs[order[n - 1]]):
            order[n] = order[n - 1]
            n -= 1
        order[n] = i


@inner_kernel
def _before(a: Any, b: Any) -> bool:
    if a.copy != b.copy:
        return bool(a.copy < b.copy)
    for k in range(3):
        if a.body.position_map[k] != b.body.position_map[k]:
            return bool(a.body.position_map[k] < b.body.position_map[k])
    return False
