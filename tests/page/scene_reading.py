"""What tests read of the scene view: its pixels and `window.volery`."""

from __future__ import annotations

import io
import time

import numpy as np
from PIL import Image

DRAWN_S = 600.0
"""A loaded machine draws WebGL slowly."""


def wait_for_world(page):
    """Wait until the world is drawn."""
    page.wait_for_function(
        "() => window.volery !== undefined && window.volery.firstRenderMs > 0",
        timeout=1000 * DRAWN_S,
    )


def wait_for_frames(page, count=3):
    """Until so many more frames are drawn."""
    page.wait_for_function(
        "([from, count]) => window.volery.frames >= from + count",
        arg=[page.evaluate("window.volery.frames"), count],
        timeout=1000 * DRAWN_S,
    )


def wait_for_rest(page):
    """Until the camera stands still, as after the first frame."""
    seen = []

    def rests(page):
        wait_for_frames(page)
        seen.append(eye(page))
        return len(seen) > 2 and np.ptp(seen[-3:], axis=0).max() < 1e-3

    wait_until(page, rests)


def wait_until(page, condition, timeout_s=DRAWN_S):
    """Until a Python condition of the page is true; the last value that it gave."""
    ends = time.monotonic() + timeout_s
    while not (value := condition(page)):
        assert time.monotonic() < ends, "it has not happened in the scene view"
        page.wait_for_timeout(100)
    return value


def pixels(page):
    """(height, width, 3) the scene as it is on the screen, 0 to 1."""
    image = page.get_by_label("Scene", exact=True).screenshot()
    return np.asarray(Image.open(io.BytesIO(image)).convert("RGB"), dtype=float) / 255.0


def eye(page):
    """(3,) m, map: where the camera is."""
    return np.array(page.evaluate("window.volery.camera.position"))


def on_screen(page, uav):
    """What `window.volery` says of a UAV."""
    return next(one for one in page.evaluate("window.volery.uavs()") if one["name"] == uav)


def project(page, point):
    """(x, y) where a position (m, map) is in the window, CSS pixels; by the camera's pose alone."""
    camera = page.evaluate("window.volery.camera")
    box = page.get_by_label("Scene", exact=True).locator("canvas").first.bounding_box()
    x, y, z, w = camera["quaternion"]
    axes = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
            [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
            [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
        ]
    )  # right, up and back of the camera, in the map
    right, up, back = axes @ (np.asarray(point, float) - camera["position"])
    assert back < 0, "it is behind the camera"
    focal = 0.5 * box["height"] / np.tan(np.radians(camera["fov"]) / 2.0)
    return (
        box["x"] + 0.5 * box["width"] - focal * right / back,
        box["y"] + 0.5 * box["height"] + focal * up / back,
    )
