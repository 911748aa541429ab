"""Compiles a first start's kernels in two processes: this one and a helper."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from volery.runtime.warmup.tasks import Task, do, is_done, is_own, name_of, task_of

_HELPER = """
import sys
sys.modules["scipy"] = None
from volery.runtime.warmup.parallel_compilation import help_with
help_with(sys.argv[1:])
"""
"""Program of the helper. Where scipy is installed, numba imports its linear algebra for matrix
products, which no kernel of ours has."""
_IS_HELPER = "VOLERY_COMPILES_FOR_ANOTHER"
_AT_ONCE = 255
"""Max number of tasks; an index fits into a byte."""


@contextmanager
def compiled(tasks: Sequence[Task]) -> Iterator[None]:
    """Runs the missing tasks; in the body, the helper may still be running its last one.

    All tasks are done at the end. This process runs those of other packages itself, at each start.
    """
    missing = [task for task in tasks if is_own(task) and not is_done(task)][:_AT_ONCE]
    if not missing or os.environ.get(_IS_HELPER):
        yield
    else:
        with _helper(missing) as (helper, numbers):
            for number in _indices_from(numbers):
                do(missing[number])
            yield
            helper.wait()
    for task in tasks:
        # Also tasks that a failed helper has left undone.
        if not (is_own(task) and is_done(task)):
            do(task)


def compile_all(tasks: Sequence[Task]) -> None:
    """Runs the missing ones of `tasks`."""
    with compiled(tasks):
        pass


def help_with(names: Sequence[str]) -> None:
    """Runs some of the named tasks in the helper; their indices arrive through stdin."""
    for number in _indices_from(sys.stdin.fileno()):
        do(task_of(names[number]))


@contextmanager
def _helper(tasks: Sequence[Task]) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """Starts a process that works on `tasks`, and the pipe from which it reads indices."""
    numbers, end = os.pipe()
    try:
        os.write(end, bytes(range(len(tasks))))
        os.close(end)
        helper = subprocess.Popen(
            [sys.executable, "-P", "-c", _HELPER, *map(name_of, tasks)],
            env={**os.environ, _IS_HELPER: "1"},
            stdin=numbers,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            yield helper, numbers
        finally:
            helper.kill()
            helper.wait()
    finally:
        os.close(numbers)


def _indices_from(numbers: int) -> Iterator[int]:
    """Yields indices from a pipe that several processes read."""
    while number := os.read(numbers, 1):
        yield number[0]
