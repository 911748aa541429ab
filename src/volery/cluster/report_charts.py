"""Charts of a study's report, as SVG in the colours of the page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap
from numpy.typing import NDArray

from volery.cluster.confidence import MeanEstimate, estimate_mean
from volery.cluster.report_data import ParameterAxis, is_fraction
from volery.cluster.summary import estimate_text
from volery.core.arrays import Array
from volery.figures.charts import as_svg, new_axes
from volery.figures.palette import FAINT, INK, UAV_COLORS

_BLUE, _ORANGE = UAV_COLORS[0], UAV_COLORS[1]
_BINS, _CURVE_BINS = 24, 8
_MIN_PER_BIN = 2
_MAX_DOTS = 4000
_MAX_TEXT = 12
_MAP = LinearSegmentedColormap.from_list("study", ["#e8590c", "#f4d58d", "#2c8a5b"])
"""Colours of a map from bad to good."""


def distribution_chart(values: Array, label: str) -> str:
    """Draws a metric's distribution, its median, and its mean with the confidence interval."""
    finite = values[np.isfinite(values)]
    figure, axes = new_axes()
    if is_fraction(finite):
        counts = [int((finite == 0.0).sum()), int((finite == 1.0).sum())]
        axes.bar(["0", "1"], counts, width=0.6, color=_BLUE, alpha=0.8)
        axes.set_xlabel(f"{label}: {_interval_text(estimate_mean(finite.tolist()))}")
    else:
        axes.hist(finite, bins=_BINS, color=_BLUE, alpha=0.8)
        estimate = estimate_mean(finite.tolist())
        if np.isfinite(estimate.half_width):
            axes.axvspan(estimate.low, estimate.high, color=_ORANGE, alpha=0.35, linewidth=0.0)
        axes.axvline(estimate.mean, color=_ORANGE, linewidth=1.6)
        axes.axvline(float(np.median(finite)), color=INK, linewidth=1.2, linestyle=(0, (3, 2)))
        axes.set_xlabel(f"{label}: mean {estimate_text(estimate)}")
    axes.set_ylabel("runs")
    return as_svg(figure)


def sensitivity_chart(parameter: ParameterAxis, values: Array, label: str) -> str:
    """Draws a metric over a parameter: runs as dots, means with their confidence intervals."""
    figure, axes = new_axes()
    finite = np.isfinite(values)
    binary = is_fraction(values)
    if not binary:
        shown = np.flatnonzero(finite)
        shown = shown[:: max(1, len(shown) // _MAX_DOTS)]
        spread = _spread(parameter, shown)
        axes.plot(
            parameter.numbers[shown] + spread,
            values[shown],
            linestyle="none",
            marker="o",
            markersize=3.0,
            color=_BLUE,
            alpha=0.35,
            markeredgewidth=0.0,
        )
    positions, estimates = _means(parameter, np.where(finite, values, np.nan))
    middle = [estimate.mean for estimate in estimates]
    low = [max(estimate.mean - estimate.low, 0.0) for estimate in estimates]
    high = [max(estimate.high - estimate.mean, 0.0) for estimate in estimates]
    bars = np.nan_to_num(np.array([low, high]), posinf=0.0)
    axes.errorbar(
        positions,
        middle,
        yerr=bars,
        color=_ORANGE,
        linewidth=1.6 if parameter.is_numeric else 0.0,
        elinewidth=1.6,
        capsize=3.0,
        marker="o",
        markersize=4.0,
    )
    _label_levels(axes, parameter)
    if binary:
        axes.set_ylim(-0.03, 1.03)
    axes.set_ylabel(label)
    return as_svg(figure)


def correlation_chart(names: Sequence[str], correlations: Sequence[float], label: str) -> str:
    """Draws the rank correlation of each parameter with a metric."""
    order = np.argsort(np.abs(correlations))
    figure, axes = new_axes(height=max(1.0 + 0.3 * len(names), 1.6))
    shown = [correlations[k] for k in order]
    colors = [_BLUE if value >= 0.0 else _ORANGE for value in shown]
    axes.barh([names[k] for k in order], shown, height=0.62, color=colors)
    axes.axvline(0.0, color=FAINT, linewidth=1.0)
    axes.set_xlim(-1.0, 1.0)
    axes.set_xlabel(f"rank correlation with {label}")
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0, labelcolor=INK)
    return as_svg(figure)


def success_map(
    across: ParameterAxis, up: ParameterAxis, values: Array, label: str, *, low_is_bad: bool
) -> str:
    """Draws the mean of a metric over two parameters; of continuous ones, each run as a dot."""
    figure, axes = new_axes(height=3.6)
    colors = _MAP if low_is_bad else _MAP.reversed()
    is_grid = bool(across.levels and up.levels)
    means = _mean_grid(across, up, values) if is_grid else values
    limits = (0.0, 1.0) if is_fraction(values) else _limits(means)
    if is_grid:
        drawn: ScalarMappable = axes.pcolormesh(means, cmap=colors, vmin=limits[0], vmax=limits[1])
        for axis, parameter in ((axes.xaxis, across), (axes.yaxis, up)):
            axis.set_ticks(np.arange(len(parameter.levels)) + 0.5, parameter.labels)
        if len(across.levels) <= _MAX_TEXT and len(up.levels) <= _MAX_TEXT:
            for (row, column), mean in np.ndenumerate(means):
                if np.isfinite(mean):
                    text = f"{mean:.2f}" if limits == (0.0, 1.0) else f"{mean:.3g}"
                    centre = (column + 0.5, row + 0.5)
                    axes.annotate(text, centre, ha="center", va="center", fontsize=8.5)
        axes.grid(visible=False)
    else:
        shown = np.isfinite(values)
        drawn = axes.scatter(
            across.numbers[shown],
            up.numbers[shown],
            c=values[shown],
            cmap=colors,
            vmin=limits[0],
            vmax=limits[1],
            s=14.0,
            linewidths=0.0,
        )
        for axis, parameter in ((axes.xaxis, across), (axes.yaxis, up)):
            if not parameter.is_numeric:
                axis.set_ticks(np.arange(len(parameter.levels)), parameter.labels)
    axes.set_xlabel(across.name)
    axes.set_ylabel(up.name)
    bar = figure.colorbar(drawn, ax=axes, label=label)
    bar.outline.set_visible(False)
    bar.ax.tick_params(colors=FAINT, labelsize=9)
    bar.ax.yaxis.label.set_color(FAINT)
    return as_svg(figure)


def _means(parameter: ParameterAxis, values: Array) -> tuple[list[float], list[MeanEstimate]]:
    """Returns positions and means: of each level, or of bins with equally many runs."""
    positions: list[float] = []
    estimates: list[MeanEstimate] = []
    if parameter.levels:
        own = parameter.level_of()
        numbers = parameter.levels if parameter.is_numeric else range(len(parameter.levels))
        groups = [(float(number), own == k) for k, number in enumerate(numbers)]
    else:
        edges = np.quantile(parameter.numbers, np.linspace(0.0, 1.0, _CURVE_BINS + 1))
        bins = np.clip(np.searchsorted(edges, parameter.numbers, "right") - 1, 0, _CURVE_BINS - 1)
        groups = [
            (float(np.median(parameter.numbers[bins == k])), bins == k)
            for k in range(_CURVE_BINS)
            if (bins == k).sum() >= _MIN_PER_BIN
        ]
    for position, chosen in groups:
        estimate = estimate_mean(values[chosen].tolist())
        if estimate.count:
            positions.append(position)
            estimates.append(estimate)
    return positions, estimates


def _mean_grid(across: ParameterAxis, up: ParameterAxis, values: Array) -> Array:
    """Returns the means (rows of `up`, columns of `across`); nan without runs."""
    grid = np.full((len(up.levels), len(across.levels)), np.nan)
    columns, rows = across.level_of(), up.level_of()
    for row in range(len(up.levels)):
        for column in range(len(across.levels)):
            found = values[(rows == row) & (columns == column) & np.isfinite(values)]
            if len(found):
                grid[row, column] = found.mean()
    return grid


def _spread(parameter: ParameterAxis, shown: NDArray[np.int64]) -> Array:
    """Returns small offsets that keep the dots of one level apart."""
    if not parameter.levels or len(parameter.levels) < 2:
        return np.zeros(len(shown))
    numbers = np.array(parameter.levels, np.float64) if parameter.is_numeric else None
    step = 1.0 if numbers is None else float(np.diff(numbers).min())
    offsets = np.arange(len(shown), dtype=np.float64) * 0.618034 % 1.0 - 0.5
    return np.asarray(offsets * 0.3 * step, dtype=np.float64)


def _label_levels(axes: Axes, parameter: ParameterAxis) -> None:
    axes.set_xlabel(parameter.name)
    if not parameter.is_numeric:
        axes.set_xticks(range(len(parameter.levels)), parameter.labels)


def _limits(values: Array) -> tuple[float, float]:
    finite = values[np.isfinite(values)]
    return float(finite.min()), float(finite.max())


def _interval_text(estimate: MeanEstimate) -> str:
    return f"{estimate.mean:.3g}, {estimate.low:.3g} to {estimate.high:.3g} with 95 % confidence"
