"""Sensor models: data files in `models/`, or a user's own beside the scenario."""

from __future__ import annotations

from pathlib import Path
from typing import TypeVar

from volery.scenario.base import Bounded
from volery.scenario.data_files import find_data_file, load_data_file

_SHIPPED = Path(__file__).parent / "models"


class SensorModel(Bounded):
    """Numbers of a sensor as its data file states them."""


Model = TypeVar("Model", bound=SensorModel)


def load_model(kind: type[Model], what: str, name: str | Path, folder: Path | None) -> Model:
    """Model by shipped name or `.toml` path, also beside the scenario in `folder`.

    `what` names the kind of sensor in errors. Raises `DataFileError` naming file and key.
    """
    return read_model(find_model(name, what, folder), kind)


def find_model(name: str | Path, what: str, folder: Path | None) -> Path:
    """Path of a model's file; see `load_model`."""
    return find_data_file(str(name), _SHIPPED, f"{what} model", folder)


def read_model(path: Path, kind: type[Model]) -> Model:
    """Model of a file, with its base. Raises `DataFileError` naming file and key."""
    return load_data_file(path, kind, _SHIPPED)
