"""Data files that describe parts (airframes, sensors): TOML checked against a pydantic model."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from volery.core.errors import DataFileError, reason_of
from volery.scenario.base import Bounded, implausible
from volery.scenario.load import describe_validation_error

Model = TypeVar("Model", bound=BaseModel)


def load_data_file(path: Path, model: type[Model]) -> Model:
    """Read `path` into `model`. Raises `DataFileError` naming file, key and what is allowed."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise DataFileError(f"{path}: cannot be read: {reason_of(error)}") from None
    except tomllib.TOMLDecodeError as error:
        raise DataFileError(f"{path}: not valid TOML: {error}") from None
    try:
        value = model.model_validate(data)
    except ValidationError as error:
        raise DataFileError(describe_validation_error(error, str(path), model, data)) from None
    fault = None if isinstance(value, Bounded) else implausible(value)
    if fault is not None:
        raise DataFileError(f"{path}: key '{fault[0]}': {fault[1]}")
    return value


def find_data_file(name: str, shipped: Path, what: str, folder: Path | None = None) -> Path:
    """Path of a part: a `.toml` path (in `folder` or as given) or a shipped name.

    Names that a scenario gives pass through its `ScenarioAccess.find_model` first. Raises
    `DataFileError` listing the shipped names.
    """
    if name.endswith(".toml"):
        for place in ((folder or Path()) / name, Path(name)):
            if place.is_file():
                return place
        raise DataFileError(f"no {what} file '{name}'")
    known = sorted(p.stem for p in shipped.glob("*.toml"))
    if name in known:
        return shipped / f"{name}.toml"
    near = difflib.get_close_matches(name, known, n=1)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    raise DataFileError(f"no {what} '{name}'.{hint} Known: {', '.join(known)}, or a .toml path")
