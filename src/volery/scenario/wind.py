"""The wind of a scenario: mean wind, gusts and turbulence; vectors are ENU."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from volery.scenario.base import Data, Positive, Vector3

MAX_WIND_M_S = 60.0
"""Maximum component of any wind, gust or node of a field."""
MAX_GUSTS = 64
"""Maximum number of gusts in a weather."""

_Height = Annotated[float, Field(ge=0.1, le=304.8)]


class LogProfile(Data):
    """Logarithmic growth of the steady wind with height above ground."""

    kind: Literal["log"] = "log"
    """Logarithmic growth with height."""
    reference_height_m: _Height = 10.0
    """Height of velocity_m_s."""
    roughness_m: Annotated[float, Field(ge=1e-6, le=10.0)] = 0.03
    """Roughness length of the ground."""

    @model_validator(mode="after")
    def _reference_is_above_roughness(self) -> Self:
        if self.reference_height_m < 2.0 * self.roughness_m:
            raise ValueError("reference_height_m must be at least twice roughness_m")
        return self


class PowerProfile(Data):
    """Growth of the steady wind with a power of the height above ground."""

    kind: Literal["power"] = "power"
    """Growth with a power of the height."""
    reference_height_m: _Height = 10.0
    """Height of velocity_m_s."""
    exponent: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0 / 7.0
    """Exponent of the power; 1/7: open country."""


class Gust(Data):
    """A 1-cosine gust that rises, holds, and falls to its end."""

    amplitude_m_s: Vector3
    """Maximum wind of the gust, map."""
    start_s: Annotated[float, Field(ge=0.0, le=1e6)]
    """Simulated time at which the gust begins."""
    rise_s: Annotated[float, Field(ge=1e-3, le=1e6)] | None = None
    """Time from zero to the full gust, and back; the gust reaches all positions at once."""
    rise_m: Annotated[float, Field(ge=1.0, le=1e5)] | None = None
    """Instead of rise_s: length of the rise in a front that moves with the steady wind."""
    end_s: Positive | None = None
    """End of the fall; None: the gust is permanent."""

    @model_validator(mode="after")
    def _rises_one_way(self) -> Self:
        _check_speed("amplitude_m_s", self.amplitude_m_s)
        if (self.rise_s is None) == (self.rise_m is None):
            raise ValueError("a gust needs either rise_s or rise_m")
        if self.rise_s is not None:
            _check_end("end_s", self, self.rise_s)
        return self


class Wind(Data):
    """Motion of the air: steady wind (with a profile) or a field, gusts, turbulence."""

    velocity_m_s: Vector3 = (0.0, 0.0, 0.0)
    """Steady wind."""
    profile: Annotated[LogProfile | PowerProfile | None, Field(discriminator="kind")] = None
    """Growth of the steady wind with height; None: it is uniform."""
    field: str | None = None
    """A .csv or .npz file of velocities on a regular grid, instead of the steady wind."""
    turbulence: Literal["none", "light", "moderate", "severe"] = "none"
    """Intensity of the turbulence (Dryden)."""
    w20_m_s: Annotated[float, Field(ge=0.0, le=MAX_WIND_M_S)] | None = None
    """Instead of turbulence: the mean wind at 20 ft (6.1 m) that sets its intensity."""
    gusts: Annotated[tuple[Gust, ...], Field(max_length=MAX_GUSTS)] = ()
    """Gusts at set times."""

    @model_validator(mode="after")
    def _is_flyable(self) -> Self:
        _check_speed("velocity_m_s", self.velocity_m_s)
        return self

    @model_validator(mode="after")
    def _has_one_source(self) -> Self:
        if self.field is not None and (self.profile is not None or any(self.velocity_m_s)):
            raise ValueError("a field replaces velocity_m_s and profile; leave them out")
        if self.w20_m_s is not None and self.turbulence != "none":
            raise ValueError("turbulence and w20_m_s exclude each other; leave one out")
        return self

    @model_validator(mode="after")
    def _fronts_are_carried(self) -> Self:
        for k, gust in enumerate(self.gusts):
            if gust.rise_m is None:
                continue
            if self.speed_m_s < 0.1:
                raise ValueError(
                    f"gusts[{k}].rise_m needs a velocity_m_s of 0.1 m/s or more that carries the "
                    "front; give rise_s instead"
                )
            _check_end(f"gusts[{k}].end_s", gust, gust.rise_m / self.speed_m_s)
        return self

    @property
    def speed_m_s(self) -> float:
        """Speed of the steady wind."""
        x, y, z = self.velocity_m_s
        return float((x * x + y * y + z * z) ** 0.5)


def _check_end(key: str, gust: Gust, rise_s: float) -> None:
    min_end_s = gust.start_s + 2.0 * rise_s
    if gust.end_s is not None and gust.end_s < min_end_s - 1e-6:
        raise ValueError(
            f"{key} must leave time to rise and to fall: at least {min_end_s:g} s is needed"
        )


def _check_speed(key: str, velocity: Vector3) -> None:
    if max(abs(v) for v in velocity) > MAX_WIND_M_S:
        raise ValueError(f"{key} components must lie within +-{MAX_WIND_M_S:g} m/s")
