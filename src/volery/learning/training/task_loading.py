"""Loads a task by name, or from a user's module or file."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

from volery.core.errors import ScenarioError
from volery.learning.task import Task
from volery.learning.tasks import EVALUATION_TASKS, TASKS, load_task

_FORMS = "a task is a shipped one ({}), module:function or file.py:function"


def find_task(name: str | Task) -> Task:
    """Returns a shipped task, or what `module:function` or `file.py:function` returns.

    Raises `ScenarioError` if there is no such task, or the function returns none.
    """
    if isinstance(name, Task):
        return name
    if ":" not in name:
        if name not in TASKS and name not in EVALUATION_TASKS:
            raise ScenarioError(f"unknown task '{name}'; {_FORMS.format(', '.join(TASKS))}")
        return load_task(name)
    where, _, function = name.rpartition(":")
    module = _file(where) if where.endswith(".py") else _module(where)
    make: Callable[[], Any] | None = getattr(module, function, None)
    if not callable(make):
        raise ScenarioError(f"{where} has no function '{function}' that returns a task")
    task = make()
    if not isinstance(task, Task):
        raise ScenarioError(f"{name} returns {type(task).__name__}, not a Task")
    return task


def _file(where: str) -> ModuleType:
    path = Path(where).absolute()
    if not path.is_file():
        raise ScenarioError(f"{where}: no such file; {_FORMS.format(', '.join(TASKS))}")
    spec = importlib.util.spec_from_file_location(f"volery_task_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ScenarioError(f"{where} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    sys.path.insert(0, str(path.parent))
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ScenarioError(f"{where}: {type(error).__name__}: {error}") from error
    finally:
        sys.path.remove(str(path.parent))
    return module


def _module(where: str) -> ModuleType:
    try:
        return importlib.import_module(where)
    except ImportError as error:
        raise ScenarioError(f"cannot import '{where}': {error}") from None
