"""Downwash: the jet of air below a UAV, and its effect on UAVs below.

Momentum theory gives the rotors' induced speed and the speed of the air far below a disc:

    v_i = sqrt(T / (2 rho A))        w = 2 v_i

with T the thrust and A the area of all rotors, pi R^2. The jet points straight down, spreads and
conserves its momentum; at depth s below the rotors and distance r from its axis

    w(s, r) = v_i (1 + s / sqrt(s^2 + R^2)) (R / b) exp(-r^2 / b^2)        b = R + 0.1 s

which is v_i at the disc (an actuator disc's inflow), and a Gaussian of momentum flux
rho w_0^2 pi b^2 / 2 = T far below. It ends smoothly at 2.5 b and fades out over the last third of
100 R (modelling choices, as are the vertical direction and the rate of spread). It acts on a
UAV below as moving air: its rotors lose thrust and its body is dragged down.

The search for neighbours is by conservative advancement, as for contacts: each UAV has a
budget of distance that it may fly before it can meet a jet or reach another UAV with its own; for
each pair the two budgets never exceed the gap. Only a UAV without budget searches, along the order
of the UAVs in x. Fleets without UAVs above each other therefore cost next to nothing, and the sum
of jets, taken in the order of positions, depends on positions alone.
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
"""Length of the jet in radii R."""
EDGE = 2.5
"""Half width of the jet in radii b."""
_FADE_FROM = 2.0 / 3.0
_AT_EDGE = math.exp(-EDGE * EDGE)
_INVERSE_SLANT = 1.0 / math.sqrt(1.0 + (EDGE * SPREAD) ** 2)
_LOOK_BEYOND = 2.0
"""Search distance beyond the widest jet, m; half of it is flown until the next search."""

_REFILL_BELOW = 0.5
"""Remaining budget, m, below which a UAV joins a search by others, so that searches coincide."""


JET = np.dtype(
    [
        ("row", "i8"),  # of the UAV at this position in the order
        ("copy", "i8"),  # of the scenario, that UAV's
        ("x", "f8"),
        ("y", "f8"),
        ("z", "f8"),
        ("radius", "f8"),
        ("downwash", "f8"),  # m/s downwards at the UAV whose row has this number
    ],
    align=True,
)
"""Entries of a search. Not a state: only `row` is reused, and any order of the rows gives the same
result."""


def new_jets(count: int) -> NDArray[np.void]:
    """Allocates memory (N,) of `JET` for a fleet of `count` UAVs."""
    jets = np.zeros(count, JET)
    jets["row"] = np.arange(count)
    return jets


@apart_kernel
def find_downwash(uavs: NDArray[np.void], models: NDArray[np.void], jets: Any) -> None:
    """Computes the `downwash` of `jets`, m/s, from the present positions and thrusts."""
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
    """Sorts the UAVs by copy, x, y, z; returns the half width of the widest jet, m."""
    count = uavs.shape[0]
    low, high, widest = math.inf, -math.inf, 0.0
    for k in range(count):  # by insertion: little changes between searches
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
def _refill_budgets(uavs: Any, jets: Any, k: int, radius: float) -> None:
    """Divides the gap to each neighbour of UAV number `k` in order between the two UAVs.

    A closed gap is ignored: for UAVs `in_jet` the jets above are summed at every tick.
    """
    own = uavs[jets[k].row].body
    own.in_jet = False
    budget = 0.5 * _LOOK_BEYOND * _INVERSE_SLANT
    first, last = _window(jets, k, radius)
    for n in range(first, last):
        if n != k and abs(jets[n].y - jets[k].y) < radius:
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
def _jets_over(uavs: Any, models: Any, jets: Any, k: int, radius: float) -> float:
    """Returns the downward speed of the air at UAV number `k` in order, m/s, summed in order."""
    speed = 0.0
    first, last = _window(jets, k, radius)
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
    """Returns the speed (m/s) of a jet of `thrust` N, `radius` m, at r off and s below it, m."""
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
    """Returns a lower bound of the distance to the jet of a disc, r off and s below it, m.

    Negative inside. The change is at most the distance moved.
    """
    depth = DEPTH * radius
    wide = EDGE * (radius + SPREAD * min(max(s, 0.0), depth))
    return max((r - wide) * _INVERSE_SLANT, -s, s - depth)


@inner_kernel
def _offset(jets: Any, k: int, n: int) -> tuple[float, float]:
    """Returns the horizontal distance of number `k` from number `n`, and its depth below; m."""
    dx = jets[k].x - jets[n].x
    dy = jets[k].y - jets[n].y
    return math.sqrt(dx * dx + dy * dy), jets[n].z - jets[k].z


@inner_kernel
def _window(jets: Any, k: int, radius: float) -> tuple[int, int]:
    """Returns the range in order of UAVs in the same copy within `radius` m in x of number `k`."""
    copy, x = jets[k].copy, jets[k].x
    first = k
    while first > 0 and jets[first - 1].copy == copy and x - jets[first - 1].x <= radius:
        first -= 1
    last = k + 1
    while last < len(jets) and jets[last].copy == copy and jets[last].x - x <= radius:
        last += 1
    return first, last
