"""What the small map shows, by its pixels alone."""

from __future__ import annotations

import io

import numpy as np
from PIL import Image

RING_PX = 12.0
"""Radius of the circle around the selected UAV."""
CLOSED = 0.7
"""Of the circle, as much must be red: its name crosses it."""


def map_canvas(page):
    return page.get_by_role("application", name="Map")


def red_circle(page):
    """(x, y) the middle of the red circle, CSS pixels of the map; None: there is none."""
    image = Image.open(io.BytesIO(map_canvas(page).screenshot())).convert("RGB")
    red, green, blue = np.moveaxis(np.asarray(image, dtype=int), 2, 0)
    mask = (red > 190) & (green < 125) & (blue < 125)
    angles = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    score = np.zeros(mask.shape)
    for angle in angles:
        dx, dy = np.rint(RING_PX * np.array([np.cos(angle), np.sin(angle)])).astype(int)
        score += np.roll(mask, (dy, dx), axis=(0, 1))
    fraction = score / len(angles)
    if fraction.max() < CLOSED:
        return None
    rows, columns = np.nonzero(fraction > fraction.max() - 0.05)
    return np.array([columns.mean(), rows.mean()])
