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

from volery.vehicle.compiled import apart_kernel, inner_kernel
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
_LOOK_BEYOND = 2.0
"""m beyond the widest jet that a look reaches, and twice what may be flown until the next."""

_REFILL_BELOW = 0.5
"""m: who has less left looks around when somebody must, so that looks come together."""


JET = np.dtype(
    [
        ("row", "i8"),  # of the UAV at this place in the order
        ("copy", "i8"),  # of the scenario, that UAV's
        ("x", "f8"),
        ("y", "f8"),
        ("z", "f8"),
        ("radius", "f8"),
        ("downwash", "f8"),  # m/s downwards at the UAV whose row has this number
    ],
    align=True,
)
"""What a look around notes. No state: of an earlier look only `row` is read, and any order of the
rows gives the same result."""


def new_jets(count: int) -> NDArray[np.void]:
    """Room (N,) of `JET` for a fleet of `count` UAVs."""
    jets = np.zeros(count, JET)
    jets["row"] = np.arange(count)
    return jets


@apart_kernel
def find_downwash(uavs: NDArray[np.void], models: NDArray[np.void], jets: Any) -> None:
    """Fill the `downwash` of `jets`, from the present places and thrusts."""
    count = uavs.shape[0]
    waiting = False
    under = False
    for i in range(count):
        jets[i].downwash = 0.0
        waiting = waiting or uavs[i].body.downwash_budget <= 0.0
        under = under or uavs[i].body.in_jet
    if not (waiting or under):
        return
    widest = _line_up(uavs, models, jets)
    if waiting:
        for k in range(count):
            if uavs[jets[k].row].body.downwash_budget < _REFILL_BELOW:
                _refill_budgets(uavs, jets, k, _LOOK_BEYOND + widest)
    for k in range(count):
        i = jets[k].row
        if uavs[i].body.in_jet:
            jets[i].downwash = _jets_over(uavs, models, jets, k, widest)


@inner_kernel
def _line_up(uavs: Any, models: Any, jets: Any) -> float:
    """Sort the UAVs by copy, x, y, z; the half width of the widest jet between them, m."""
    count = uavs.shape[0]
    low, high, widest = math.inf, -math.inf, 0.0
    for k in range(count):  # by insertion: from one look to the next little changes
        i = jets[k].row
        body = uavs[i].body
        x, y, z = body.position_map[0], body.position_map[1], body.position_map[2]
        radius = models[uavs[i].model].plant.jet_radius
        low, high, widest = min(low, z), max(high, z), max(widest, radius)
        n = k
        while n > 0 and _is_before(uavs[i].copy, x, y, z, jets[n - 1]):
            _note(jets[n], jets[n - 1].row, jets[n - 1].copy, jets[n - 1].radius)
            jets[n].x, jets[n].y, jets[n].z = jets[n - 1].x, jets[n - 1].y, jets[n - 1].z
            n -= 1
        _note(jets[n], i, uavs[i].copy, radius)
        jets[n].x, jets[n].y, jets[n].z = x, y, z
    return EDGE * (widest + SPREAD * min(high - low, DEPTH * widest))


@inner_kernel
def _note(jet: Any, row: int, copy: int, radius: float) -> None:
    jet.row = row
    jet.copy = copy
    jet.radius = radius


@inner_kernel
def _is_before(copy: int, x: float, y: float, z: float, other: Any) -> bool:
    if copy != other.copy:
        return bool(copy < other.copy)
    if x != other.x:
        return bool(x < other.x)
    if y != other.y:
        return bool(y < other.y)
    return bool(z < other.z)


@inner_kernel
def _refill_budgets(uavs: Any, jets: Any, k: int, reach: float) -> None:
    """Share the gap to each neighbour of UAV number `k` in order between the two of them.

    A gap that is closed counts no more: who is `in_jet` sums the jets over him at every tick.
    """
    own = uavs[jets[k].row].body
    own.in_jet = False
    budget = 0.5 * _LOOK_BEYOND * _INVERSE_SLANT
    first, last = _window(jets, k, reach)
    for n in range(first, last):
        if n != k and abs(jets[n].y - jets[k].y) < reach:
            r, s = _offset(jets, k, n)
            other = uavs[jets[n].row].body
            over, below = _gap(r, s, jets[n].radius), _gap(r, -s, jets[k].radius)
            if over <= 0.0:
                own.in_jet = True
                over = _LOOK_BEYOND
            if below <= 0.0:
                other.in_jet = True
                below = _LOOK_BEYOND
            half = 0.5 * min(over, below)
            budget = min(budget, half)
            if half < _LOOK_BEYOND:
                other.downwash_budget = min(other.downwash_budget, half)
    own.downwash_budget = budget


@inner_kernel
def _jets_over(uavs: Any, models: Any, jets: Any, k: int, reach: float) -> float:
    """Speed of the air downwards at UAV number `k` in order, m/s, summed in that order."""
    speed = 0.0
    first, last = _window(jets, k, reach)
    for n in range(first, last):
        r, s = _offset(jets, k, n)
        if n != k and _gap(r, s, jets[n].radius) < 0.0:
            body = uavs[jets[n].row].body
            thrust = 0.0
            for rotor in range(models[uavs[jets[n].row].model].plant.rotors):
                w = body.rotor_speed[rotor]
                thrust += body.rotor_lift[rotor] * w * w
            speed += jet_speed(thrust, jets[n].radius, r, s)
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
def _offset(jets: Any, k: int, n: int) -> tuple[float, float]:
    """How far number `k` in order is off the vertical through number `n`, and below it; m."""
    dx = jets[k].x - jets[n].x
    dy = jets[k].y - jets[n].y
    return math.sqrt(dx * dx + dy * dy), jets[n].z - jets[k].z


@inner_kernel
def _window(jets: Any, k: int, reach: float) -> tuple[int, int]:
    """Range in order of the UAVs in the same copy within `reach` m in x of number `k`."""
    copy, x = jets[k].copy, jets[k].x
    first = k
    while first > 0 and jets[first - 1].copy == copy and x - jets[first - 1].x <= reach:
        first -= 1
    last = k + 1
    while last < len(jets) and jets[last].copy == copy and jets[last].x - x <= reach:
        last += 1
    return first, last
