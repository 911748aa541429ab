"""Notes which of Volery's kernels a process compiles or needs.

As a pytest plugin: which kernels tests need beyond those of `python -m volery.runtime.warmup`.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from numba.core import event

from volery.core.kernel_cache import KernelCache
from volery.runtime.warmup.requirements import all_needs
from volery.runtime.warmup.tasks import do


class CompileWatch(event.Listener):
    """`compiled`: each kernel and the types of its arguments, from now on."""

    def __init__(self) -> None:
        self.compiled: list[str] = []
        event.register("numba:compile", self)

    def on_start(self, event: Any) -> None:
        _note(self.compiled, event.data["dispatcher"].py_func, event.data["args"])

    def on_end(self, event: Any) -> None:
        """Nothing is noted twice."""


class NeedsWatch:
    """`needed`: each kernel that is compiled or loaded from the cache, from now on.

    What a first start compiles in flight, a later one loads in flight: so a full cache serves to
    reveal what an empty one lacks.
    """

    def __init__(self) -> None:
        self.needed: list[str] = []
        load: Any = KernelCache.load_overload

        def note_and_load(cache: Any, signature: Any, context: Any) -> Any:
            _note(self.needed, cache._py_func, signature)
            return load(cache, signature, context)

        KernelCache.load_overload = note_and_load


def _note(found: list[str], function: Any, types: Any) -> None:
    if function.__module__.startswith("volery."):
        found.append(f"{function.__module__}.{function.__name__} {types}")


def pytest_configure(config: Any) -> None:
    for task in all_needs():
        do(task)
    config.needs_watch = NeedsWatch()


def pytest_unconfigure(config: Any) -> None:
    Path(os.environ["NEEDED_TO"]).write_text(json.dumps(config.needs_watch.needed))
