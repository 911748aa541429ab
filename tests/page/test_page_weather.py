"""Sliders of the weather are worked, and checked in the simulation and in the scene view."""

import numpy as np
import pytest
from page_browsing import save_screenshot
from scene_reading import pixels, wait_for_frames, wait_for_world, wait_until
from truth import collect_vehicles, hurried, of_uav, position_of, until, vehicle, weather
from working import SMALL, open_panel, set_slider

pytestmark = pytest.mark.slow

LOOK = "#view=fly&camera=-30_0_2.5_0_-0.12_0&quality=low"


@pytest.fixture(scope="module")
def opened(module_browsing, served):
    page = module_browsing.open(served.url + LOOK, viewport=SMALL)
    wait_for_world(page)
    page.keyboard.press("m")
    return page


@pytest.fixture
def page(opened, shared, served):
    page = opened
    open_panel(page, "Environment").get_by_role("button", name="Clear weather").click()
    weather(
        served,
        lambda message: message["rain"] == message["snow"] == message["fog_visibility"] == 0.0,
    )
    set_slider(page, "Hour of day", "Home")
    set_slider(page, "Hour of day", "ArrowRight", 47)  # noon
    weather(served, lambda message: message["hour_of_day"] == pytest.approx(12.0))
    wait_for_frames(page, 8)
    return page


def between(page):
    """(height, width, 3) of the scene between the panels, without the menu of views."""
    image = pixels(page)
    height, width, _ = image.shape
    return image[int(0.2 * height) :, int(0.05 * width) : int(0.95 * width)]


def restless(page):
    """How much the image changes from one frame to one soon after."""
    first = between(page)
    wait_for_frames(page, 1)
    return float(np.abs(between(page) - first).mean())


def contrast(page):
    """Between the sky and the ground close above and below the horizon."""
    image = pixels(page)
    height, width, _ = image.shape
    rows = image[:, int(0.05 * width) : int(0.95 * width)].mean(axis=1)
    sky = rows[int(0.28 * height) : int(0.34 * height)].mean(axis=0)
    ground = rows[int(0.45 * height) : int(0.52 * height)].mean(axis=0)
    return float(np.abs(sky - ground).max())


def test_the_fog_slider_hides_what_is_far(page, served):
    clear = contrast(page)
    assert clear > 0.1
    set_slider(page, "Fog", "End")
    weather(served, lambda message: message["fog_visibility"] == pytest.approx(10.0))
    wait_until(page, lambda page: contrast(page) < 0.2 * clear)
    save_screenshot(page, "fog_slider")


def test_the_hour_slider_brings_the_night(page, served):
    noon = between(page).mean()
    set_slider(page, "Hour of day", "End")
    weather(served, lambda message: message["hour_of_day"] == pytest.approx(24.0))
    wait_until(page, lambda page: between(page).mean() < 0.6 * noon)


@pytest.mark.parametrize("kind", ["Rain", "Snow"])
def test_what_falls_is_seen_to_fall(page, served, kind):
    still = min(restless(page) for _ in range(6))  # light and the last drops take their time to go
    set_slider(page, kind, "End")
    weather(served, lambda message: message[kind.lower()] > 15.0)
    wait_until(page, lambda page: restless(page) > 3.0 * still + 0.002)
    save_screenshot(page, f"{kind.lower()}_slider")


def test_wind_and_gusts_move_a_uav(page, served):
    with hurried(served):
        vehicle(served, "uav1", lambda uav: uav["mode"] == "HOLD" and uav["airborne"])
    before = position_of(served, "uav1")
    set_slider(page, "Wind from", "Home")
    set_slider(page, "Wind from", "ArrowRight", 18)  # 90 degrees: from the east
    with collect_vehicles(served) as received:
        set_slider(page, "Wind", "ArrowRight", 12)
        weather(served, lambda message: message["wind"]["x"] == pytest.approx(-6.0))
        until(
            lambda: any(uav["position"]["x"] < before[0] - 0.05 for uav in of_uav(received, "uav1"))
        )
    page.get_by_role("button", name="Clear weather").click()
    weather(served, lambda message: message["wind"]["x"] == 0.0)
    with hurried(served):
        vehicle(served, "uav1", lambda uav: abs(uav["velocity"]["x"]) < 0.05)
    with collect_vehicles(served) as received:
        page.get_by_role("button", name="Add a gust").click()
        until(lambda: any(abs(uav["velocity"]["x"]) > 0.1 for uav in of_uav(received, "uav1")))
