"""Faults: timed entries of a scenario, or injected during a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import Field, TypeAdapter, ValidationError, model_validator

from volery.core.errors import CommandError
from volery.scenario.base import Data, NonNegative, Vector3
from volery.scenario.validation import describe_validation_error

SimulatedTime = Annotated[float, Field(ge=0.0, le=1e8)]
"""Time in s; the bound is three years, far within integer nanoseconds."""


class _Fault(Data):
    at_s: SimulatedTime = 0.0
    """Simulated time at which the fault begins; a past time means at once."""


class _UavFault(_Fault):
    """A fault of one UAV."""

    uav: str
    """Name of the UAV, such as `uav1`."""


class LastingFault(_Fault):
    """A fault that lasts until it ends, or for good."""

    until_s: SimulatedTime | None = None
    """Simulated time at which the fault ends; None: it is permanent."""

    @model_validator(mode="after")
    def _ends_after_it_begins(self) -> Self:
        if self.until_s is not None and self.until_s <= self.at_s:
            raise ValueError(f"until_s = {self.until_s} must be later than at_s = {self.at_s}")
        return self


class MotorFault(LastingFault, _UavFault):
    """A rotor produces part of its thrust, or none."""

    kind: Literal["motor"] = "motor"
    """Loss of thrust of a rotor."""
    rotor: Annotated[int, Field(ge=0)]
    """Number of the rotor in the airframe's file, from 0."""
    thrust_factor: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    """Remaining fraction of its thrust; 0 stops the rotor."""


class SensorFault(LastingFault, _UavFault):
    """A sensor sends nothing, repeats its last measurement, has a bias or more noise."""

    kind: Literal["sensor"] = "sensor"
    """Fault of a sensor."""
    sensor: str
    """Name of the sensor, such as `imu`."""
    effect: Literal["dropped", "stuck", "biased", "noisy"]
    """Effect: no samples, a repeated sample, a bias, or additional noise."""
    bias: Annotated[tuple[float, ...], Field(min_length=1)] | None = None
    """Bias: a number for each measured component, in its unit."""
    sigma: Annotated[tuple[NonNegative, ...], Field(min_length=1)] | None = None
    """Standard deviation of additional Gaussian noise: a number for each measured component, in its
    unit."""

    @model_validator(mode="after")
    def _numbers_belong_to_their_effects(self) -> Self:
        for key, effect in (("bias", "biased"), ("sigma", "noisy")):
            if (self.effect == effect) != (getattr(self, key) is not None):
                raise ValueError(f'{key} is needed for effect = "{effect}", and only there')
        return self


class GnssFault(LastingFault, _UavFault):
    """No satellites are received."""

    kind: Literal["gnss_loss"] = "gnss_loss"
    """Loss of satellite signals."""


class RadioFault(LastingFault, _UavFault):
    """A UAV's radio neither sends nor receives."""

    kind: Literal["radio"] = "radio"
    """Loss of the radio."""


class JammingFault(LastingFault):
    """A transmitter covers the radios' channel with noise."""

    kind: Literal["jamming"] = "jamming"
    """A jammer."""
    position_m: Vector3
    """Position of the jammer, map."""
    power_dbm: Annotated[float, Field(ge=-30.0, le=80.0)] = 30.0
    """Power that it radiates in the channel's bandwidth, the same in all directions."""


class GustFault(_Fault):
    """A 1-cosine gust that reaches all positions at once."""

    kind: Literal["gust"] = "gust"
    """A gust."""
    velocity_m_s: Vector3
    """Maximum wind of the gust, map."""
    rise_s: Annotated[float, Field(ge=0.01, le=60.0)] = 0.5
    """Time from zero to the full gust, and back."""
    hold_s: Annotated[float, Field(ge=0.0, le=600.0)] = 1.0
    """Time at full strength."""


class DisplacementFault(_UavFault):
    """A UAV changes its position from one step to the next."""

    kind: Literal["displacement"] = "displacement"
    """A sudden change of position."""
    offset_m: Vector3
    """Offset of the position, map."""


Fault: TypeAlias = Annotated[
    MotorFault
    | SensorFault
    | GnssFault
    | RadioFault
    | JammingFault
    | GustFault
    | DisplacementFault,
    Field(discriminator="kind"),
]

_ADAPTER: TypeAdapter[Fault] = TypeAdapter(Fault)
_KINDS: dict[Any, type[_Fault]] = {
    "motor": MotorFault,
    "sensor": SensorFault,
    "gnss_loss": GnssFault,
    "radio": RadioFault,
    "jamming": JammingFault,
    "gust": GustFault,
    "displacement": DisplacementFault,
}


def parse_fault(data: Fault | Mapping[str, Any]) -> Fault:
    """Returns a fault from plain data, as in a scenario; raises `CommandError` for invalid data."""
    if isinstance(data, _Fault):
        return data
    if not isinstance(data, Mapping):
        raise CommandError(f"a fault is a table such as {{'kind': 'motor', ...}}, not {data!r}")
    kind = data.get("kind")
    if kind not in _KINDS:
        raise CommandError(f"fault: kind must be one of {', '.join(_KINDS)}, not {kind!r}")
    try:
        return _ADAPTER.validate_python(dict(data))
    except ValidationError as error:
        plain = dict(data)
        raise CommandError(describe_validation_error(error, "fault", _KINDS[kind], plain)) from None
