"""Functions that compile some kernels each: run, by name if need be, and marked when done."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

from volery.core.compiled import cache_dir
from volery.core.errors import NodeError
from volery.core.typing_cache import remembered_types

Task = Callable[[], None]
"""A function of a module, without arguments."""

_OWN = "volery."


def name_of(task: Task) -> str:
    """`module:function`."""
    return f"{task.__module__}:{task.__qualname__}"


def task_of(name: str) -> Task:
    """The function of such a name."""
    module, function = name.split(":")
    task: Task = getattr(import_module(module), function)
    return task


def is_own(task: Task) -> bool:
    """Whether it is Volery's, whose kernels' cache is known to be of this version."""
    return task.__module__.startswith(_OWN)


def is_done(task: Task) -> bool:
    """Whether the cache holds the kernels of one of Volery's own."""
    return _mark(task).exists()


def do(task: Task) -> None:
    """Compile what the cache lacks, and mark it as done.

    `NodeError` where one of another package fails.
    """
    try:
        with _quicker():
            task()
    except NodeError:
        return  # a library is missing: a node that needs it says so when it starts
    except Exception as error:
        if is_own(task):
            raise
        raise NodeError(f"warm-up {name_of(task)}: {type(error).__name__}: {error}") from error
    if is_own(task):
        _mark(task).touch()


def _mark(task: Task) -> Path:
    return cache_dir() / f"{name_of(task).replace(':', '.')}.compiled"


@contextmanager
def _quicker() -> Iterator[None]:
    """Compile without what repeats itself, and without searching for garbage.

    Compiling makes millions of small objects: a sixth of its time would go into searching.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        with remembered_types():
            yield
    finally:
        if was_on:
            gc.enable()
