"""Undoes what was made step by step: when a later step fails, or at the end."""

from __future__ import annotations

from collections.abc import Callable, Iterable

UndoStep = Callable[[], object]


class UndoSteps:
    """Functions that undo steps that have been made.

    Add the function of a step as soon as the step is made; `run` then undoes exactly what exists.
    """

    def __init__(self) -> None:
        self._steps: list[UndoStep] = []

    def add(self, step: UndoStep) -> None:
        """Adds the function that undoes a step."""
        self._steps.append(step)

    def add_each(self, steps: Iterable[UndoStep]) -> None:
        """Adds functions while an iterator makes the steps; passes on its error."""
        for step in steps:
            self.add(step)

    def run(self) -> list[Exception]:
        """Undoes all steps, newest first, and returns the errors of those that fail.

        Those stay, to be tried again by the next `run`.
        """
        errors: list[Exception] = []
        failed: list[UndoStep] = []
        while self._steps:
            step = self._steps.pop()
            try:
                step()
            except Exception as error:
                errors.append(error)
                failed.append(step)
        self._steps = failed[::-1]
        return errors
