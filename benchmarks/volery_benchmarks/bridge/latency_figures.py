"""Computes the figures of the latency tables: by message size, and of three end points."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence

import numpy as np

IMAGE_BYTES = (0, 100_000, 250_000, 500_000, 1_000_000, 2_500_000)
"""Sizes of the published images, bytes."""
END_POINTS = ("round_trip", "one_way", "stop")
TRIALS = 10
"""Number of trials, and of commands in each, as in the article."""

Latencies = Sequence[tuple[int, float]]
"""(bytes with the header, s) of each image."""


def size_figures(latencies: Latencies) -> dict[str, float]:
    """Returns median, mean and standard deviation, ms, by the size of the image."""
    figures = {}
    for size in IMAGE_BYTES:
        took = [1e3 * s for length, s in latencies if _image_bytes(length) == size]
        figures[size_figure("median", size)] = statistics.median(took)
        figures[size_figure("mean", size)] = statistics.mean(took)
        figures[size_figure("std", size)] = statistics.stdev(took)
    return figures


def size_figure(what: str, size: int) -> str:
    """Returns the name of a figure of `size_figures`; `what` is `median`, `mean` or `std`."""
    return f"latency_{size // 1000}_kb_{what}_ms"


def end_point_figures(end_point: str, trials: Sequence[Sequence[float]]) -> dict[str, float]:
    """Returns mean and standard deviation, ms, of the trials' means; `trials` are in s."""
    means = [1e3 * statistics.mean(trial) for trial in trials]
    mean, std = end_point_names(end_point)
    return {mean: statistics.mean(means), std: statistics.stdev(means)}


def end_point_names(end_point: str) -> tuple[str, str]:
    """Returns the names of the two figures of an end point."""
    return f"latency_{end_point}_10x10_ms", f"latency_{end_point}_10x10_std_ms"


def fit_line(latencies: Latencies) -> tuple[float, float]:
    """Fits L = alpha S + beta, s/MB and s, through the medians of each size."""
    sizes = sorted({size for size, _ in latencies})
    medians = [statistics.median(s for size, s in latencies if size == one) for one in sizes]
    alpha, beta = np.polyfit(np.array(sizes) / 1e6, medians, 1)
    return float(alpha), float(beta)


def one_way_latencies(
    sent_ns: Sequence[tuple[float, int]], applied_ns: Mapping[float, int]
) -> list[float]:
    """Returns the time, s, from each command until the step that applied it was reported.

    The number in a command identifies it; times are of one clock.
    """
    return [1e-9 * (applied_ns[number] - sent) for number, sent in sent_ns]


def _image_bytes(length: int) -> int:
    return max(size for size in IMAGE_BYTES if size <= length)
