"""Runs functions that compile kernels, by name if necessary, and marks them as done."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path

from volery.core.compiled import cache_dir
from volery.core.errors import NodeError
from volery.core.typing_cache import remembered_types

Task = Callable[[], None]
"""A module's function without arguments."""

_OWN = "volery."


def name_of(task: Task) -> str:
    """Returns the name of a task, `module:function`."""
    return f"{task.__module__}:{task.__qualname__}"


def task_of(name: str) -> Task:
    """Returns the task of a name."""
    module, function = name.split(":")
    task: Task = getattr(import_module(module), function)
    return task


def is_own(task: Task) -> bool:
    """Returns whether a task is Volery's, whose cached kernels match this version."""
    return task.__module__.startswith(_OWN)


def is_done(task: Task) -> bool:
    """Returns whether the cache holds the kernels of one of Volery's tasks."""
    return _mark(task).exists()


def do(task: Task) -> None:
    """Compiles what the cache lacks, and marks the task as done.

    Raises `NodeError` if a task of another package fails.
    """
    try:
        with _quicker():
            task()
    except NodeError:
        return  # a library is missing: a node that needs it reports that when it starts
    except Exception as error:
        if is_own(task):
            raise
        raise NodeError(f"warm-up {name_of(task)}: {type(error).__name__}: {error}") from error
    if is_own(task):
        # Without its folder, or room on the disk, the next start compiles again.
        with suppress(OSError):
            _mark(task).touch()


def _mark(task: Task) -> Path:
    return cache_dir() / f"{name_of(task).replace(':', '.')}.compiled"


@contextmanager
def _quicker() -> Iterator[None]:
    """Compiles without repeated type inference and without garbage collection.

    Compiling makes millions of small objects; garbage collection would take a sixth of its time.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        with remembered_types():
            yield
    finally:
        if was_on:
            gc.enable()
