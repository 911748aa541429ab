"""Plots latency against message size: Volery, the article and ROS-TCP-Endpoint."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from volery_benchmarks.bridge.article import ARTICLE_LINE, UNITY_ENDPOINT, Line
from volery_benchmarks.bridge.latency_figures import IMAGE_BYTES, size_figure
from volery_benchmarks.registry import Result

_OURS, _ARTICLE, _ENDPOINT = "#2f7ed8", "#e8590c", "#0ca678"
_POINTS = 200
_SETTINGS: Any = {
    "svg.hashsalt": "volery",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def latency_plot(result: Result, ours: Line) -> str:
    """Returns SVG: medians as dots, fitted lines; equal figures give equal text."""
    with rc_context(_SETTINGS):
        figure = Figure(figsize=(7.2, 4.2), layout="constrained")
        axes = figure.add_subplot()
        sizes = np.linspace(0.0, IMAGE_BYTES[-1], _POINTS)
        _line(axes, sizes, ARTICLE_LINE, _ARTICLE, "the 2025 article")
        _line(axes, sizes, UNITY_ENDPOINT.line, _ENDPOINT, UNITY_ENDPOINT.name)
        _line(axes, sizes, ours, _OURS, "Volery")
        _dots(axes, UNITY_ENDPOINT.medians_ms, _ENDPOINT)
        medians = {size: result.figures[size_figure("median", size)] for size in IMAGE_BYTES}
        _dots(axes, medians, _OURS)
        axes.set_yscale("log")
        axes.set_xlabel("size of the message S, MB")
        axes.set_ylabel("latency L, ms")
        axes.grid(visible=True, which="major", color="#00000022")
        axes.legend(frameon=False, fontsize="small")
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None, "Creator": "Volery"})
    return text.getvalue()


def _line(axes: Axes, sizes: NDArray[np.float64], line: Line, color: str, name: str) -> None:
    label = f"{name}: L = {line.alpha_s_per_mb:.2g} s/MB · S + {line.beta_s:.2g} s"
    latencies = [line.latency_ms(float(size)) for size in sizes]
    axes.plot(sizes / 1e6, latencies, color=color, label=label)


def _dots(axes: Axes, medians_ms: Mapping[int, float], color: str) -> None:
    megabytes = [size / 1e6 for size in medians_ms]
    axes.plot(megabytes, list(medians_ms.values()), "o", color=color, markersize=4.0)
