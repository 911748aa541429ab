"""Batteries: power of the rotors, voltage under load, charge levels.

    power     P = sum over rotors of (k_P kF w^3) / efficiency + avionics
    voltage   V = E(charge) - V_1 - I R_0,   I from P = V I
    memory    tau dV_1/dt = I R_1 - V_1                        (one RC pair)
    charge    d(charge)/dt = -I / capacity
    speed     no rotor turns faster than max_speed V / rated_v

This is the Thevenin model with one RC pair (M. Chen, G. Rincon-Mora, "Accurate electrical battery
model", IEEE Trans. Energy Conversion 21, 2006, with one of its two pairs). Updates run at
every fifth guidance tick, 25 times a second, with constant current in between, for which the RC
pair is solved exactly.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from volery.vehicle.compiled import apart_kernel, inner_kernel
from volery.vehicle.tables import NotNegative, Positive, Share, Table

GUIDANCE_TICKS = 5
"""Guidance ticks between updates."""
OCV_POINTS = 21
"""Points of the open-circuit voltage, for interpolation in kernels."""

BATTERY = np.dtype(
    [
        ("capacity", "f8"),  # A s; 0: an ideal supply
        ("open_circuit", "f8", OCV_POINTS),  # V of the pack, charge 0 to 1
        ("resistance", "f8"),
        ("pair_resistance", "f8"),
        ("pair_keep", "f8"),  # fraction of the pair's voltage left after an update
        ("avionics", "f8"),  # W
        ("speed_a_volt", "f8"),  # rad/s V
        ("low", "f8"),
        ("critical", "f8"),
        ("emergency", "f8"),
        ("period", "f8"),  # s
    ],
    align=True,
)
"""Parameters of one battery, for kernels."""


class BatteryLevel(IntEnum):
    """Charge level."""

    NORMAL = 0
    LOW = 1
    """Below the battery's `low`: time to return."""
    CRITICAL = 2
    """Below its `critical`: return home now."""
    EMERGENCY = 3
    """Below its `emergency`: land at once."""
    EMPTY = 4
    """No charge: the rotors stop."""


_LOW = int(BatteryLevel.LOW)
_CRITICAL = int(BatteryLevel.CRITICAL)
_EMERGENCY = int(BatteryLevel.EMERGENCY)
_EMPTY = int(BatteryLevel.EMPTY)


class Battery(Table):
    """A pack of cells in series, and its load."""

    cells: Annotated[int, Field(ge=1, le=24)]
    capacity_ah: Positive
    open_circuit_v: Annotated[tuple[Positive, ...], Field(min_length=2, max_length=101)]
    """Open-circuit voltage of one cell, at charges evenly spaced from empty to full."""
    resistance_ohm: NotNegative
    """Immediate resistance of the whole pack."""
    pair_resistance_ohm: NotNegative
    """Additional resistance of the whole pack after a while ..."""
    pair_time_s: Positive
    """... with this time constant."""
    efficiency: Annotated[float, Field(gt=0.0, le=1.0)]
    """Efficiency from the battery to the rotors' shafts: speed controllers and motors."""
    avionics_w: NotNegative
    rated_v: Positive
    """Voltage of the loaded pack at which rotors reach `max_speed_rad_s`."""
    power_torque_m: Positive | None = None
    """k_P, torque over thrust for the rotors' power; default: `rotors.torque_m`."""
    low: Share = 0.15
    """Charge below which the battery is low; this and the next two: PX4's `BAT_LOW_THR`, ..."""
    critical: Share = 0.07
    """... `BAT_CRIT_THR` ..."""
    emergency: Share = 0.05
    """... and `BAT_EMERGEN_THR`, with PX4's defaults; a default above `critical` is that level."""

    @model_validator(mode="after")
    def _is_a_battery(self) -> Self:
        if (np.diff(self.open_circuit_v) < 0.0).any():
            raise ValueError("open_circuit_v must not fall from empty to full")
        if not self.critical < self.low:
            raise ValueError(f"critical = {self.critical} must be below low = {self.low}")
        if "emergency" in self.model_fields_set and not self.emergency < self.critical:
            raise ValueError(
                f"emergency = {self.emergency} must be below critical = {self.critical}"
            )
        return self


def open_circuit_voltage(battery: Battery, charge: float) -> float:
    """Returns the voltage of the pack without load at a `charge` from 0 to 1, V."""
    table = battery.open_circuit_v
    return battery.cells * float(np.interp(charge, np.linspace(0.0, 1.0, len(table)), table))


def battery_row(
    battery: Battery | None, max_speed_rad_s: float, period_s: float
) -> NDArray[np.void]:
    """Returns the (1,) `BATTERY` row of a battery updated each `period_s`; None: ideal supply."""
    row = np.zeros(1, BATTERY)
    if battery is None:
        return row
    row["capacity"] = 3600.0 * battery.capacity_ah
    charges = np.linspace(0.0, 1.0, OCV_POINTS)
    row["open_circuit"] = [open_circuit_voltage(battery, charge) for charge in charges]
    row["resistance"] = battery.resistance_ohm
    row["pair_resistance"] = battery.pair_resistance_ohm
    row["pair_keep"] = math.exp(-period_s / battery.pair_time_s)
    row["avionics"] = battery.avionics_w
    row["speed_a_volt"] = max_speed_rad_s / battery.rated_v
    row["low"] = battery.low
    row["critical"] = battery.critical
    row["emergency"] = min(battery.emergency, battery.critical)
    row["period"] = period_s
    return row


@apart_kernel
def drain(body: Any, plant: Any, command: Any) -> bool:
    """Drains a `BODY`'s battery by one update; returns whether it fell to a lower level.

    plant: a `PLANT` with a battery. command: a record whose `full_thrust`, N, is set to the present
    maximum of a rotor; control stays below it.
    """
    battery = plant.battery
    power = battery.avionics
    for r in range(plant.rotors):
        w = body.rotor_speed[r]
        power += plant.rotor_power[r] * w * w * w
    source = _open_circuit(battery, body.battery_charge) - body.battery_pair_voltage
    current, voltage = _loaded(source, power, battery.resistance)
    keep = battery.pair_keep
    body.battery_pair_voltage = (
        keep * body.battery_pair_voltage + (1.0 - keep) * battery.pair_resistance * current
    )
    charge = max(body.battery_charge - current * battery.period / battery.capacity, 0.0)
    body.battery_charge = charge
    body.battery_current = current
    body.battery_voltage = voltage

    level = 0
    if charge <= 0.0:
        level = _EMPTY
    elif charge < battery.emergency:
        level = _EMERGENCY
    elif charge < battery.critical:
        level = _CRITICAL
    elif charge < battery.low:
        level = _LOW
    fell = level > body.battery_level
    body.battery_level = level
    limit = 0.0 if level == _EMPTY else min(plant.max_speed, voltage * battery.speed_a_volt)
    command.full_thrust = plant.thrust_constant * limit * limit
    return bool(fell)


@inner_kernel
def _open_circuit(battery: Any, charge: float) -> float:
    position = charge * (OCV_POINTS - 1)
    k = min(int(position), OCV_POINTS - 2)
    fraction = position - k
    low, high = battery.open_circuit[k], battery.open_circuit[k + 1]
    voltage: float = low + fraction * (high - low)
    return voltage


@inner_kernel
def _loaded(source: float, power: float, resistance: float) -> tuple[float, float]:
    """Returns current (A) and voltage (V) of a source with a resistance that supplies `power` W.

    Of two solutions, that with the smaller current; without a solution, the current of maximum
    power.
    """
    if source <= 0.0:
        return 0.0, 0.0
    room = source * source - 4.0 * resistance * power
    current = 2.0 * power / (source + math.sqrt(max(room, 0.0)))
    if room < 0.0:
        current = 0.5 * source / resistance
    return current, source - resistance * current
