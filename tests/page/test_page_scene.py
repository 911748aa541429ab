"""The scene view follows the simulation: weather, poses, links."""

import numpy as np
import pytest
from page_browsing import save_screenshot
from scene_reading import on_screen, pixels, wait_for_frames, wait_for_world, wait_until
from truth import put

pytestmark = pytest.mark.slow

LOW_OVER_GROUND = "#view=fly&camera=-30_0_2.5_0_-0.12_0&quality=low"


def set_weather(served, **changes):
    request = {"only": list(changes), **changes}
    response = served.call("/volery/set_weather", "volery_interfaces/srv/SetWeather", request)
    assert response["success"], response["message"]


def off_haze(image, haze, top, bottom):
    """How far a band (fractions of the height, left of the map) is from the haze in the mean."""
    height, width, _ = image.shape
    band = image[int(top * height) : int(bottom * height), width // 10 : 2 * width // 5]
    return float(np.abs(band.mean(axis=(0, 1)) - haze).max())


def test_fog_takes_far_contrast_before_near_one(browsing, served):
    set_weather(served, fog_visibility=0.0)
    page = browsing.open(served.url + LOW_OVER_GROUND, viewport={"width": 640, "height": 360})
    wait_for_world(page)
    wait_for_frames(page)
    clear = pixels(page)
    save_screenshot(page, "clear")
    set_weather(served, fog_visibility=40.0)
    wait_until(page, lambda page: np.abs(pixels(page) - clear).mean() > 0.05)
    wait_for_frames(page, 12)
    foggy = pixels(page)
    save_screenshot(page, "fog")
    set_weather(served, fog_visibility=0.0)
    horizon = foggy[int(0.36 * len(foggy)), 40:240]
    assert np.ptp(horizon, axis=0).max() < 0.04  # nothing but haze
    haze = horizon.mean(axis=0)
    far, near = off_haze(foggy, haze, 0.42, 0.5), off_haze(foggy, haze, 0.92, 1.0)
    assert near > 0.1  # the ground at one's feet is still there ...
    assert far < 0.25 * near  # ... and the horizon is not


def test_a_moved_uav_moves_on_the_screen(browsing, served):
    page = browsing.open(
        served.url + "#view=fly&camera=-12_0_4_0_-0.1_0&uav=uav1",
        viewport={"width": 640, "height": 360},
    )
    wait_for_world(page)
    wait_until(page, lambda page: page.evaluate("window.volery.uavs().length") > 0)
    put(served, "uav1", 0.0, 0.0, 4.0)
    before = wait_until(page, lambda page: stands_at(on_screen(page, "uav1"), 0.0))
    put(served, "uav1", 0.0, 3.0, 4.0)
    after = wait_until(page, lambda page: stands_at(on_screen(page, "uav1"), 3.0))
    # Looking east, what goes north goes to the left, by its angle.
    assert before["x"] - after["x"] > 40.0


def stands_at(seen, y):
    return seen if abs(seen["position"][1] - y) < 0.6 else None
