"""Data files that describe parts (airframes, sensors): TOML checked against a pydantic model."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from volery.core.errors import DataFileError
from volery.core.near_names import near_miss
from volery.scenario.base import Bounded, implausible
from volery.scenario.data_file_bases import FileData, read_toml, read_with_bases
from volery.scenario.validation import Model, describe_validation_error


def load_data_file(path: Path, model: type[Model], bases: Path | None = None) -> Model:
    """Reads `path` into `model`.

    Raises `DataFileError`, naming file, key and allowed values, for an invalid file. bases: folder
    of the shipped parts of this kind, which the file may modify (`base = "vlp_16"`); None: no
    bases.
    """
    file = FileData(read_toml(path), (path,)) if bases is None else read_with_bases(path, bases)
    try:
        value = model.model_validate(file.data)
    except ValidationError as error:
        fault = describe_validation_error(error, file.where, model, file.data)
        raise DataFileError(fault) from None
    wrong = None if isinstance(value, Bounded) else implausible(value)
    if wrong is not None:
        raise DataFileError(f"{file.where}: key '{wrong[0]}': {wrong[1]}")
    return value


def find_data_file(name: str, shipped: Path, what: str, folder: Path | None = None) -> Path:
    """Returns the path of a part: a `.toml` path (in `folder` or as given) or a shipped name.

    Names from a scenario pass through its `ScenarioAccess.find_model` first. Raises
    `DataFileError`, listing the shipped names, if there is no such part.
    """
    if name.endswith(".toml"):
        for path in ((folder or Path()) / name, Path(name)):
            if path.is_file():
                return path
        raise DataFileError(f"no {what} file '{name}'")
    known = sorted(p.stem for p in shipped.glob("*.toml"))
    if name in known:
        return shipped / f"{name}.toml"
    hint = near_miss(name, known)
    raise DataFileError(f"no {what} '{name}'{hint} Known: {', '.join(known)}, or a .toml path")
