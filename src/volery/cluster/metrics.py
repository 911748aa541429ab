"""Computes the metrics of a run: built-in ones and functions of the user."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from volery.cluster.built_in_metrics import FUNCTIONS
from volery.cluster.errors import StudyError
from volery.cluster.metric_names import MetricEntry, fingerprint_of
from volery.core.errors import FAILURES, VoleryError
from volery.verdicts.finished_run import NEEDS_SIMULATION, FinishedRun, arguments_of
from volery.verdicts.user_functions import needs_of


@dataclass(frozen=True)
class Metric:
    """A metric with its function."""

    entry: MetricEntry
    """Name and parameters."""
    function: Callable[..., Any]
    """Function of parts of a `FinishedRun`."""
    needs: tuple[str, ...]
    """Names of those parts."""
    fingerprint: str
    """Hash of the function and its parameters."""

    @property
    def needs_simulation(self) -> bool:
        """Whether a run among other environments lacks a part."""
        return any(name in NEEDS_SIMULATION for name in self.needs)

    def values(self, run: FinishedRun) -> dict[str, float]:
        """Returns the metric's values by name. Raises what the function raises."""
        arguments = arguments_of(run, self.needs)
        result = self.function(**arguments, **dict(self.entry.parameters))
        name = self.entry.name
        if isinstance(result, Mapping):
            return {f"{name}.{key}": _number(item, name) for key, item in result.items()}
        return {name: _number(result, name)}


def load_metrics(entries: Sequence[MetricEntry], folder: Path) -> tuple[Metric, ...]:
    """Imports the functions of metrics. Raises `StudyError` if one does not exist or fit."""
    with _importing_from(folder, Path().resolve()):
        return tuple(_load(entry, folder) for entry in entries)


def _load(entry: MetricEntry, folder: Path) -> Metric:
    function = FUNCTIONS[entry.function] if entry.is_built_in else _import(entry.function, folder)
    given = dict(entry.parameters)
    try:
        needs = needs_of(function, given)
    except VoleryError as error:
        raise StudyError(f"metric '{entry.name}': {entry.function}: {error}") from None
    return Metric(entry, function, needs, fingerprint_of(entry, folder))


def _import(function: str, folder: Path) -> Callable[..., Any]:
    module_name, _, name = function.partition(":")
    try:
        module = _import_module(module_name, folder)
    except FAILURES as error:
        raise StudyError(
            f"metric {function}: {module_name} cannot be imported: {type(error).__name__}: {error}"
        ) from error
    found = getattr(module, name, None)
    if not callable(found):
        raise StudyError(f"metric {function}: {module_name} has no function '{name}'")
    result: Callable[..., Any] = found
    return result


def _import_module(name: str, folder: Path) -> Any:
    if not name.endswith(".py"):
        return importlib.import_module(name)
    path = folder / name
    alias = f"volery_study_{path.stem}"
    spec = importlib.util.spec_from_file_location(alias, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[alias] = module
    spec.loader.exec_module(module)
    return module


@contextmanager
def _importing_from(*folders: Path) -> Iterator[None]:
    """Also finds modules in folders, after all others."""
    before = list(sys.path)
    sys.path += [str(folder) for folder in folders]
    try:
        yield
    finally:
        sys.path[:] = before


def _number(value: Any, name: str) -> float:
    if isinstance(value, bool | np.bool_ | int | float | np.number):
        return float(value)
    raise StudyError(
        f"metric '{name}' returned {type(value).__name__}; return a number, or numbers by name"
    )
