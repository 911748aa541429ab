"""Base classes of scenario data: frozen, validated, with the common kinds of numbers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, get_args

from annotated_types import Ge, Gt
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from volery.core.errors import ScenarioError
from volery.core.quantities import Quantity, fault_in
from volery.scenario.validation import describe_validation_error

Vector2 = tuple[float, float]
Vector3 = tuple[float, float, float]
PROJECTED = Quantity("m", 3.5e7, 1e-9)
"""Limits of projected coordinates; the largest have a zone's number before the easting."""
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]
Topic = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*(/[a-z][a-z0-9_]*)*$", max_length=120)]
Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Rate = Annotated[float, Field(gt=0.0, le=1000.0)]


class Bounded(BaseModel):
    """Frozen data whose numbers are within the bounds of the quantities that their keys name.

    Unknown keys and numbers that are not finite are rejected. See `core.quantities`.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    quantities: ClassVar[Mapping[str, Quantity]] = {}
    """Bounds for the keys of this data, instead of the common ones."""

    @field_validator("*")
    @classmethod
    def _is_plausible(cls, value: Any, info: ValidationInfo) -> Any:
        fault = _fault_of(cls, str(info.field_name), value)
        if fault is not None:
            raise ValueError(fault)
        return value


def implausible(data: BaseModel, prefix: str = "") -> tuple[str, str] | None:
    """Returns the first key with an invalid number, and the error; None: all are valid.

    For models that are not `Bounded`, which validate such numbers themselves.
    """
    for key in type(data).model_fields:
        value, where = getattr(data, key), f"{prefix}.{key}" if prefix else key
        if isinstance(value, BaseModel):
            inner = implausible(value, where)
            if inner is not None:
                return inner
            continue
        fault = _fault_of(type(data), key, value)
        if fault is not None:
            return where, fault
    return None


def _fault_of(model: type[BaseModel], key: str, value: Any) -> str | None:
    low, positive = _lower_bound(model, key)
    special = model.quantities if issubclass(model, Bounded) else None
    return fault_in(key, value, special=special, low=low, positive=positive)


@cache
def _lower_bound(model: type[BaseModel], key: str) -> tuple[float | None, bool]:
    """Returns the lower bound of a key's type, and whether it is exclusive."""
    field = model.model_fields[key]
    for word in (*field.metadata, *_metadata(field.annotation)):
        if isinstance(word, Gt) and word.gt == 0:
            return 0.0, True
        if isinstance(word, Ge) and isinstance(word.ge, int | float):
            return float(word.ge), False
    return None, False


def _metadata(annotation: Any) -> list[Any]:
    """Returns the metadata of a type's numbers, also in lists and unions."""
    found = list(getattr(annotation, "__metadata__", ()))
    for word in tuple(found):
        found += getattr(word, "metadata", ())
    for inner in get_args(annotation):
        found += _metadata(inner)
    return found


class Data(Bounded):
    """A table of a scenario, made from a file or in Python.

    In Python, arrays and lists may stand for tuples; the constructor raises `ScenarioError`, naming
    key and allowed values, for invalid values.
    """

    model_config = ConfigDict(str_strip_whitespace=True)

    if not TYPE_CHECKING:  # type checkers read the parameters from the fields

        def __init__(self, /, **data: Any) -> None:
            try:
                super().__init__(**data)
            except ValidationError as error:
                model = type(self)
                text = describe_validation_error(error, model.__name__, model, data)
                raise ScenarioError(text) from None

        # Marks the constructor as pydantic's own: validation of nested tables does not call it.
        __init__.__pydantic_base_init__ = True

    def model_post_init(self, _context: Any, /) -> None:
        """Counts `kind` as given: it says which table this is, in a file too."""
        if "kind" in type(self).model_fields:
            self.model_fields_set.add("kind")

    def __repr_args__(self) -> Iterable[tuple[str | None, Any]]:
        """Yields the keys that were given, without those that have their defaults."""
        given = self.model_fields_set
        return [(key, value) for key, value in super().__repr_args__() if key in given]

    @model_validator(mode="before")
    @classmethod
    def _take_arrays(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        return {key: _without_arrays(value) for key, value in data.items()}


def _without_arrays(value: Any, depth: int = 8) -> Any:
    """Returns arrays and their numbers as lists and numbers, in lists and tables too."""
    if depth and isinstance(value, list | tuple):
        return [_without_arrays(item, depth - 1) for item in value]
    if depth and isinstance(value, Mapping):
        return {key: _without_arrays(item, depth - 1) for key, item in value.items()}
    return value.tolist() if hasattr(value, "tolist") else value


class SensorData(Data):
    """Common keys of all sensors."""

    phase_s: NonNegative = 0.0
    """Time of the first measurement."""


class MountedSensor(SensorData):
    """A sensor with a mount on the UAV."""

    quantities: ClassVar[Mapping[str, Quantity]] = {
        "position_m": Quantity("m", 100.0, 0.0, {"mm": 1e-3})
    }

    position_m: Vector3 = (0.0, 0.0, 0.0)
    """Position of the sensor frame in the body, FLU."""
    rpy_deg: Vector3 = (0.0, 0.0, 0.0)
    """Roll, pitch and yaw of the sensor frame in the body, FLU."""
    noise: bool = True
    """Whether samples have noise; false: they are exact."""


def check_rectangle(region: tuple[float, float, float, float] | None) -> None:
    """Raises `ValueError` unless `region` is x_min, y_min, x_max, y_max, or None."""
    if region is not None and not (region[0] < region[2] and region[1] < region[3]):
        raise ValueError("region_m must be [x_min, y_min, x_max, y_max] with min < max")
