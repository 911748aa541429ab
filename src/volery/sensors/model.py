"""Sensor models: data files in `models/`, or user files relative to the scenario."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Self, TypeVar

from volery.scenario.base import Bounded
from volery.scenario.data_files import find_data_file, load_data_file

_SHIPPED = Path(__file__).parent / "models"


class SensorModel(Bounded):
    """Parameters of a sensor, with the keys of its data file."""

    sensor_kind: ClassVar[str]
    """Kind of sensor, for errors."""

    @classmethod
    def load(cls, name: str | Path, folder: Path | None = None) -> Self:
        """Returns the model by shipped name or `.toml` path, also relative to `folder`.

        Raises `DataFileError`, naming file and key, for an invalid file.
        """
        return read_model(find_model(name, cls.sensor_kind, folder), cls)


Model = TypeVar("Model", bound=SensorModel)


def find_model(name: str | Path, what: str, folder: Path | None) -> Path:
    """Returns the path of the file of a `what` model; see `SensorModel.load`."""
    return find_data_file(str(name), _SHIPPED, f"{what} model", folder)


def read_model(path: Path, kind: type[Model]) -> Model:
    """Reads the model of a file, with its base; raises `DataFileError`, naming file and key."""
    return load_data_file(path, kind, _SHIPPED)
