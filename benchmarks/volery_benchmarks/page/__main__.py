"""Runs the bench with a shorter memory test: `python -m volery_benchmarks.page [SECONDS]`."""

import logging
import sys

from volery_benchmarks.page.measuring import measure
from volery_benchmarks.registry import find

if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    soak_s = float(sys.argv[1]) if len(sys.argv) > 1 else 60.0
    measured, bounds = measure(soak_s), find("page").bounds
    for figure, value in measured.figures.items():
        print(f"{figure:32} {value:10.4g}  {bounds.get(figure, '')}")  # noqa: T201
    for what, reason in measured.failures.items():
        print(f"not measured: {what}: {reason}")  # noqa: T201
