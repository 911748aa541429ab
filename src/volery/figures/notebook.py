"""Figures for scripts and notebooks: axes of pyplot, PNG within HTML, tables of a state."""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes

_MAP_WIDTH_PX = 640


def png_html(png: bytes) -> str:
    """Returns an `<img>` that holds a PNG."""
    data = base64.b64encode(png).decode("ascii")
    return f'<img width="{_MAP_WIDTH_PX}" alt="map" src="data:image/png;base64,{data}">'


def state_html(name: str, kind: str, rows: Mapping[str, str]) -> str:
    """Returns a heading, which names an object and its kind, and a table of its state as HTML."""
    cells = "".join(f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in rows.items())
    return f"<div><b>{escape(name)}</b> {escape(kind)}</div><table>{cells}</table>"


def new_axes() -> Axes:
    """Returns the axes of a new figure of pyplot, which notebooks and `pyplot.show()` show."""
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]
