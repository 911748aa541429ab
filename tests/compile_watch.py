"""Notes which of Volery's kernels numba compiles; as a pytest plugin it leaves them in a file."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from numba.core import event


class CompileWatch(event.Listener):
    """`compiled`: each kernel and the types of its arguments, from now on."""

    def __init__(self) -> None:
        self.compiled: list[str] = []
        event.register("numba:compile", self)

    def on_start(self, event: Any) -> None:
        function = event.data["dispatcher"].py_func
        if function.__module__.startswith("volery."):
            name = f"{function.__module__}.{function.__name__}"
            self.compiled.append(f"{name} {event.data['args']}")

    def on_end(self, event: Any) -> None:
        """Nothing is noted twice."""


def pytest_configure(config: Any) -> None:
    config.compile_watch = CompileWatch()


def pytest_unconfigure(config: Any) -> None:
    Path(os.environ["COMPILED_TO"]).write_text(json.dumps(config.compile_watch.compiled))
