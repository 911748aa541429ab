"""Sensor models: data files in `models/`, or user files relative to the scenario."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from volery.scenario.base import Bounded
from volery.scenario.data_files import find_data_file, load_data_file

_SHIPPED = Path(__file__).parent / "models"


class SensorModel(Bounded):
    """Parameters of a sensor, with the keys of its data file."""


Model = TypeVar("Model", bound=SensorModel)


def load_model(kind: type[Model], what: str, name: str | Path, folder: Path | None) -> Model:
    """Returns a model by shipped name or `.toml` path, also relative to the scenario's `folder`.

    `what` names the kind of sensor in errors. Raises `DataFileError`, naming file and key, for an
    invalid file.
    """
    return read_model(find_model(name, what, folder), kind)


def find_model(name: str | Path, what: str, folder: Path | None) -> Path:
    """Returns the path of a model's file; see `load_model`."""
    return find_data_file(str(name), _SHIPPED, f"{what} model", folder)


def read_model(path: Path, kind: type[Model]) -> Model:
    """Reads the model of a file, with its base; raises `DataFileError`, naming file and key."""
    return load_data_file(path, kind, _SHIPPED)
