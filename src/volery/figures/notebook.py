"""Figures for scripts and notebooks: axes of pyplot, and PNG within HTML."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MAP_WIDTH_PX = 640


def png_html(png: bytes) -> str:
    """Returns an `<img>` that holds a PNG."""
    data = base64.b64encode(png).decode("ascii")
    return f'<img width="{_MAP_WIDTH_PX}" alt="map" src="data:image/png;base64,{data}">'


def new_axes() -> Axes:
    """Returns the axes of a new figure of pyplot, which notebooks and `pyplot.show()` show."""
    from matplotlib import pyplot

    return pyplot.subplots(layout="constrained")[1]
