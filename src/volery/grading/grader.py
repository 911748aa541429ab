"""Grades all submissions of an assignment, several at a time."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from pathlib import Path

from volery.core.machine import usable_cores
from volery.grading.assignment import Assignment, load_assignment
from volery.grading.graded_flight import fly
from volery.grading.grades import Grade, GradedFlight
from volery.grading.submissions import Submission

_loaded = cache(load_assignment)
"""The assignment at a path, once for each worker process."""


def grade(
    assignment: Assignment,
    submissions: Sequence[Submission],
    *,
    jobs: int | None = None,
    on_flight: Callable[[GradedFlight], None] = lambda _flight: None,
) -> list[Grade]:
    """Flies each submission with all seeds and returns the grades, in the order of submissions.

    jobs: number of flights at a time; None: one for each core. on_flight: called for each finished
    flight. A submission that cannot fly has a grade with the reason.
    """
    tasks = [(submission, seed) for submission in submissions for seed in assignment.seeds]
    workers = min(jobs or usable_cores(), len(tasks))
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        flights = []
        for flight in pool.map(partial(_fly, assignment.path), tasks):
            on_flight(flight)
            flights.append(flight)
    count = len(assignment.seeds)
    return [
        Grade(submission.name, tuple(flights[k * count : (k + 1) * count]), assignment.points)
        for k, submission in enumerate(submissions)
    ]


def _fly(path: Path, task: tuple[Submission, int]) -> GradedFlight:
    return fly(_loaded(path), *task)
