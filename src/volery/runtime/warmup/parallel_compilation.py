"""Two processes share what a first start compiles: this one and a helper."""

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
"""What the helper runs. Where scipy is installed, numba imports its linear algebra for products of
matrices: no kernel of ours has one."""
_IS_HELPER = "VOLERY_COMPILES_FOR_ANOTHER"
_AT_ONCE = 255
"""Tasks whose number fits into a byte."""


@contextmanager
def compiled(tasks: Sequence[Task]) -> Iterator[None]:
    """Do what of `tasks` has not been done; the helper may still be at its last one in the body.

    At the end all is done. Those of other packages this process does itself, at each start.
    """
    missing = [task for task in tasks if is_own(task) and not is_done(task)][:_AT_ONCE]
    if not missing or os.environ.get(_IS_HELPER):
        yield
    else:
        with _helper(missing) as (helper, numbers):
            for number in _taken_from(numbers):
                do(missing[number])
            yield
            helper.wait()
    for task in tasks:
        # What a helper that failed has left undone, too.
        if not (is_own(task) and is_done(task)):
            do(task)


def compile_all(tasks: Sequence[Task]) -> None:
    """Do what of `tasks` has not been done, and nothing beside."""
    with compiled(tasks):
        pass


def help_with(names: Sequence[str]) -> None:
    """In the helper: do some of the tasks of such names, whose numbers come through stdin."""
    for number in _taken_from(sys.stdin.fileno()):
        do(task_of(names[number]))


@contextmanager
def _helper(tasks: Sequence[Task]) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """A process that works on `tasks`, and the pipe from which it takes the number of the next."""
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


def _taken_from(numbers: int) -> Iterator[int]:
    """Numbers of a pipe from which others may take some, too."""
    while number := os.read(numbers, 1):
        yield number[0]
