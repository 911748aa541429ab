"""Colours of the report, legible on a light page and on a dark one."""

from __future__ import annotations

UAV_COLORS = (
    "#2f7ed8",
    "#e8590c",
    "#0ca678",
    "#ae3ec9",
    "#e03162",
    "#c98a00",
    "#1098ad",
    "#6b8e23",
)

INK, FAINT, GRID = "#010203", "#010204", "#010205"
"""Placeholder colours of charts; the page replaces them by its light or dark colours."""

CSS_NAMES = {INK: "var(--ink)", FAINT: "var(--faint)", GRID: "var(--grid)"}


def uav_color(number: int) -> str:
    """Returns the colour of UAV `number`, from 0; the colours repeat."""
    return UAV_COLORS[number % len(UAV_COLORS)]
