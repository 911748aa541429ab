"""Grading: nodes of students flown in isolation, with the same seeds for all, and points."""

from volery.grading.assignment import Assignment, load_assignment
from volery.grading.grader import grade
from volery.grading.grades import Grade, GradedFlight
from volery.grading.submissions import Submission, find_submissions

__all__ = [
    "Assignment",
    "Grade",
    "GradedFlight",
    "Submission",
    "find_submissions",
    "grade",
    "load_assignment",
]
