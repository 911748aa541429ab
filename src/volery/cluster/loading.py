"""Loads a `Study` from a TOML file and checks it against its scenario."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from volery.cluster.errors import StudyError
from volery.cluster.metric_names import check_metrics
from volery.cluster.points import Point, points_of, values_of
from volery.cluster.study import Study
from volery.core.errors import ScenarioError, reason_of
from volery.core.toml_text import parse_toml
from volery.scenario.load import list_scenarios, load_scenario
from volery.scenario.schema import Scenario
from volery.scenario.validation import validated

_CHECKED_VALUES = 200
"""Values of a parameter that are checked before the first run."""


@dataclass(frozen=True)
class LoadedStudy:
    """A study with its scenario and all parameter points."""

    study: Study
    where: str
    """Path of the study's file, or another word for it in errors."""
    folder: Path
    """Folder of relative names."""
    is_trusted: bool
    """Whether code from the folders of the study and of the scenario may run."""
    scenario: Scenario
    """The scenario with the changes that all runs share."""
    points: tuple[Point, ...]
    """All parameter points, in order."""

    @property
    def duration_s(self) -> float:
        """Simulated time of a run, s."""
        return self.study.duration_s or self.scenario.duration_s

    def seeds_of(self, point: Point) -> tuple[int, ...]:
        """Returns the seeds of a point's runs: the study's, or the value of a parameter `seed`."""
        own = next((v for n, v in point.items() if self.study.parameters[n].key == "seed"), None)
        return self.study.all_seeds if own is None else (int(own),)

    def scenario_of(self, point: Point) -> Scenario:
        """Returns the scenario of a parameter point, with the scenario's own seed.

        Raises `StudyError`, naming the file and the point, for an invalid value.
        """
        changes = {self.study.parameters[name].key: value for name, value in point.items()}
        changes["duration_s"] = self.duration_s
        try:
            return self.scenario.with_(changes)
        except ScenarioError as error:
            raise StudyError(f"{self.where}: {_words(point)}: {_line(error)}") from None


def load_study(
    source: str | Path | Mapping[str, Any] | Study, *, trust: bool = False
) -> LoadedStudy:
    """Loads a study from a TOML file, plain data or a `Study`, and checks it.

    trust: whether metrics and nodes may be modules in the folders of the study and the scenario.
    Raises `StudyError`, naming file, key and allowed values, for an invalid study.
    """
    if isinstance(source, str | Path):
        path = Path(source)
        study, where, folder = read_study(path), str(path), path.parent
    else:
        study = source if isinstance(source, Study) else parse_study(dict(source), "study")
        where, folder = f"study '{study.name}'", Path()
    folder = folder.resolve()
    check_metrics(study, where, folder, is_trusted=trust)
    scenario = scenario_of_study(study, where, folder, trust=trust)
    loaded = LoadedStudy(study, where, folder, trust, scenario, points_of(study, where))
    _check_values(loaded)
    return loaded


def parse_study(data: dict[str, Any], where: str) -> Study:
    """Returns the study of plain data. Raises `StudyError`, naming the key, for invalid data."""
    try:
        return validated(data, Study, where)
    except ScenarioError as error:
        raise StudyError(_line(error)) from None


def read_study(path: Path) -> Study:
    """Returns the study of a TOML file; its scenario and metrics are not looked at.

    Raises `StudyError`, naming file and key, for an invalid file.
    """
    return parse_study(_read(path), str(path))


def _read(path: Path) -> dict[str, Any]:
    if path.is_dir():
        raise StudyError(f"{path} is a folder; a study is a .toml file")
    try:
        return parse_toml(path.read_text(encoding="utf-8-sig"))
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(f"{path}: cannot be read: {reason_of(error)}") from None
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{path}: not valid TOML: {error}") from None


def scenario_of_study(study: Study, where: str, folder: Path, *, trust: bool) -> Scenario:
    """Returns the scenario with the changes that all runs share.

    Raises `StudyError`, naming file and key, if it does not exist or the changes do not fit.
    """
    name: str | Path = study.scenario
    if study.scenario not in list_scenarios() and (folder / study.scenario).exists():
        name = folder / study.scenario
    try:
        scenario = load_scenario(name, trust=trust)
    except ScenarioError as error:
        raise StudyError(f"{where}: key 'scenario': {_line(error)}") from None
    try:
        return scenario.with_(study.changes) if study.changes else scenario
    except ScenarioError as error:
        raise StudyError(f"{where}: [changes]: {_line(error)}") from None


def _check_values(loaded: LoadedStudy) -> None:
    """Raises `StudyError` if the scenario lacks a parameter's key, or rejects one of its values."""
    first = loaded.points[0]
    loaded.scenario_of({})
    for name, parameter in loaded.study.parameters.items():
        values = values_of(parameter) or (first[name],)
        for value in values[:_CHECKED_VALUES]:
            try:
                loaded.scenario.with_({parameter.key: value})
            except ScenarioError as error:
                raise StudyError(
                    f"{loaded.where}: parameters.{name}: key '{parameter.key}' = {value!r}: "
                    f"{_line(error)}"
                ) from None


def _words(point: Point) -> str:
    return ", ".join(f"{name} = {value!r}" for name, value in point.items()) or "scenario"


def _line(error: Exception) -> str:
    """Returns the text of an error in one line."""
    return " ".join(part.strip() for part in str(error).splitlines())
