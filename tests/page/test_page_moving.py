"""Hands move UAVs: handles in the scene, clicks on map and ground, a gamepad."""

import re

import numpy as np
import pytest
from map_reading import map_canvas, red_circle
from page_browsing import save_screenshot
from scene_reading import (
    on_screen,
    project,
    wait_for_frames,
    wait_for_rest,
    wait_for_world,
    wait_until,
)
from truth import hurried, position_of, put, until, vehicle
from working import WIDE, inspect, pull

pytestmark = pytest.mark.slow

LOOK = "#view=fly&camera=-9_0_8_0_-0.5_0&quality=minimal&uav=uav1"
HOMES = {"uav1": (0.0, 0.0, 3.0), "uav2": (0.0, 5.0, 3.0), "uav3": (8.0, -3.0, 3.0)}
HANDLE_OF_DISTANCE = 0.09
PAD = """
window.pad = { axes: [0, 0, 0, 0], buttons: [], connected: true, id: "pad", index: 0 };
navigator.getGamepads = () => [null, window.pad];
document.hasFocus = () => true;
"""
DRAWN_MAP = "() => new Promise((drawn) => setTimeout(drawn, 300))"
"""The map draws fifteen times a second by a timer of the same thread, which comes before this."""


@pytest.fixture(scope="module")
def served(chromium):
    from page_serving import Served

    with Served("hover", "--uavs", "3") as server:
        with hurried(server):
            for uav in HOMES:
                vehicle(server, uav, lambda state: state["mode"] == "HOLD")  # after its take-off
        yield server


@pytest.fixture(scope="module")
def opened(module_browsing, served):
    page = module_browsing.open(served.url + LOOK, viewport=WIDE)
    wait_for_world(page)
    return page


@pytest.fixture
def homes(served):
    """All UAVs at their home positions."""
    for uav, home in HOMES.items():
        put(served, uav, *home)
        served.call(f"/{uav}/hold", "std_srvs/srv/Trigger")


@pytest.fixture
def page(opened, shared, served, homes):
    opened.goto(served.url + LOOK)  # only its part behind the # may be another one
    opened.get_by_role("option", name="uav1").click()
    return opened


# -------------------------------------------------------------------------------- gamepad


def test_flight_by_gamepad(browsing, served, homes):
    page = browsing.open(served.url + LOOK, viewport=WIDE, init_script=PAD)
    wait_for_world(page)
    page.get_by_role("option", name="uav1").click()
    page.keyboard.press("c")
    hands = page.get_by_role("group", name="Manual control")
    hands.get_by_text("gamepad").wait_for()
    page.evaluate("window.pad.axes = [0, 0, 0, -1]")  # the right stick ahead
    vehicle(served, "uav1", lambda uav: uav["velocity"]["x"] > 1.5 and uav["mode"] == "VELOCITY")
    page.evaluate("window.pad.axes = [0, -1, 0, 0]")  # the left stick up
    vehicle(served, "uav1", lambda uav: uav["velocity"]["z"] > 0.7)
    x, _, z = position_of(served, "uav1")
    wait_until(page, lambda page: on_screen(page, "uav1")["position"][2] > z)
    assert x > HOMES["uav1"][0] + 0.5
    page.evaluate("window.pad.axes = [-1, 0, 0, 0]")  # the left stick to the left
    vehicle(served, "uav1", lambda uav: abs(uav["velocity"]["z"]) < 0.2)
    until(lambda: heading(served, "uav1") > 0.5, what="it did not turn left")
    page.evaluate("window.pad.axes = [0.05, -0.05, 0.05, 0.05]")  # within the dead zone
    vehicle(served, "uav1", lambda uav: np.hypot(*list(uav["velocity"].values())[:2]) < 0.2)
    save_screenshot(page, "gamepad")


def heading(served, uav):
    """rad, counter-clockwise from east."""
    request = {"entity": uav}
    response = served.call("/get_entity_state", "simulation_interfaces/srv/GetEntityState", request)
    turned = response["state"]["pose"]["orientation"]
    return 2.0 * np.arctan2(turned["z"], turned["w"])


def circle_of(page, uav):
    """Where the red circle is once this UAV is selected."""
    page.get_by_role("option", name=uav).click()
    page.get_by_role("option", name=uav, selected=True).wait_for()
    page.evaluate(DRAWN_MAP)
    found = []
    wait_until(page, lambda page: found.append(red_circle(page)) or found[-1] is not None)
    return found[-1]


def test_the_map_zooms_follows_and_shows_all(browsing, served, homes):
    page = browsing.open(served.url + LOOK, viewport=WIDE)
    page.get_by_role("option", name="uav1").wait_for()
    before = {uav: circle_of(page, uav) for uav in ("uav1", "uav3")}
    apart = np.linalg.norm(before["uav3"] - before["uav1"])
    map_canvas(page).focus()
    page.keyboard.press("+")
    wait_until(page, lambda page: np.linalg.norm(red_circle(page) - before["uav3"]) > 3.0)
    closer = np.linalg.norm(circle_of(page, "uav1") - circle_of(page, "uav3"))
    assert closer == pytest.approx(1.4 * apart, rel=0.1)
    box = map_canvas(page).bounding_box()
    middle = [box["width"] / 2, box["height"] / 2]
    page.get_by_role("button", name="Follow the selected UAV").click()
    wait_until(page, lambda page: np.linalg.norm(red_circle(page) - middle) < 3.0)
    page.get_by_role("button", name="Show all").click()
    wait_until(page, lambda page: np.linalg.norm(red_circle(page) - before["uav3"]) < 3.0)


# ------------------------------------------------------------------------------- positions


def near(seen, wanted, metres):
    return np.hypot(seen[0] - wanted[0], seen[1] - wanted[1]) < metres


def arrives(served, uav, x, y):
    with hurried(served):
        until(lambda: near(position_of(served, uav), (x, y), 0.4), what=f"{uav} did not come")


# -------------------------------------------------------------------------------- handles


def handle_scale(page, at):
    eye = np.array(page.evaluate("window.volery.camera.position"))
    return max(0.5, HANDLE_OF_DISTANCE * np.linalg.norm(eye - at))


def test_a_uav_is_dragged_level_by_its_ring(page, served):
    map_before = red_circle(page)
    page.keyboard.press("v")
    wait_for_frames(page, 3)
    at = np.array(position_of(served, "uav1"))
    grip = np.add(
        at, [-handle_scale(page, at), 0.0, 0.0]
    )  # of the ring, what is nearest to the eye
    pull(page, project(page, grip), project(page, np.add(grip, [2.0, -3.0, 0.0])))
    arrives(served, "uav1", at[0] + 2.0, at[1] - 3.0)
    assert position_of(served, "uav1")[2] == pytest.approx(at[2], abs=0.4)
    wait_until(
        page, lambda page: near(on_screen(page, "uav1")["position"], np.add(at, [2, -3, 0]), 0.5)
    )
    wait_until(page, lambda page: np.linalg.norm(red_circle(page) - map_before) > 4.0)
    save_screenshot(page, "dragged")


def test_a_uav_is_lifted_by_its_arrow(page, served):
    page.keyboard.press("v")
    wait_for_frames(page, 3)
    at = np.array(position_of(served, "uav1"))
    below = on_screen(page, "uav1")
    grip = np.add(at, [0.0, 0.0, 0.9 * handle_scale(page, at)])
    pull(page, project(page, grip), project(page, np.add(grip, [0.0, 0.0, 2.0])))
    with hurried(served):
        until(
            lambda: abs(position_of(served, "uav1")[2] - at[2] - 2.0) < 0.4,
            what="it was not lifted",
        )
    assert near(position_of(served, "uav1"), at, 0.4)
    wait_until(page, lambda page: on_screen(page, "uav1")["y"] < below["y"] - 20)


def test_without_the_handles_a_drag_only_turns_the_view(page, served):
    at = np.array(position_of(served, "uav1"))
    seen = on_screen(page, "uav1")
    start = project(page, np.add(at, [-1.0, 0.0, 0.0]))
    pull(page, start, (start[0] + 120, start[1]))
    wait_until(page, lambda page: abs(on_screen(page, "uav1")["x"] - seen["x"]) > 40)
    assert near(position_of(served, "uav1"), at, 0.3)


# ------------------------------------------------------------------------------------ map


def test_the_map_circles_the_selected_uav_and_a_click_sends_it(page, served):
    circles = {uav: circle_of(page, uav) for uav in ("uav2", "uav3", "uav1")}
    offset = np.subtract(HOMES["uav3"], HOMES["uav1"])[:2]
    drawn = circles["uav3"] - circles["uav1"]
    scale = np.linalg.norm(drawn) / np.linalg.norm(offset)  # pixels a metre
    # East is to the right and north up, for all three.
    for uav, circle in circles.items():
        east, north = np.subtract(HOMES[uav], HOMES["uav1"])[:2]
        assert circle - circles["uav1"] == pytest.approx([scale * east, -scale * north], abs=3.0)
    page.get_by_role("button", name="Send the selected UAV by click").click()
    x, y = circles["uav1"] + scale * np.array([6.0, 4.0])  # 6 m east, 4 m south
    map_canvas(page).click(position={"x": float(x), "y": float(y)})
    arrives(served, "uav1", 6.0, -4.0)
    wait_until(page, lambda page: np.linalg.norm(red_circle(page) - [x, y]) < 4.0)
    wait_until(page, lambda page: near(on_screen(page, "uav1")["position"], (6.0, -4.0), 0.5))
    save_screenshot(page, "map_click")
    # A click on another UAV selects that one instead.
    x, y = circles["uav2"]
    map_canvas(page).click(position={"x": float(x), "y": float(y)})
    page.get_by_role("option", name="uav2", selected=True).wait_for()


def test_a_click_on_the_ground_sends_the_selected_uav(page, served):
    panel = inspect(page, "uav1")
    wait_for_frames(page, 3)
    panel.get_by_role("button", name="Go to a clicked position").click()
    page.get_by_text("click the ground or the map").wait_for()
    page.mouse.click(*project(page, (3.0, -2.0, 0.0)))
    arrives(served, "uav1", 3.0, -2.0)


def test_new_uavs_stand_where_one_clicks(page, served):
    page.get_by_role("button", name="Add UAVs").click()
    page.get_by_role("group", name="Add UAVs").get_by_role("button", name="Click position").click()
    page.mouse.click(*project(page, (2.0, 3.0, 0.0)))
    vehicle(served, "uav4")
    assert near(position_of(served, "uav4"), (2.0, 3.0), 1.0)
    seen = wait_until(
        page,
        lambda page: [u for u in page.evaluate("window.volery.uavs()") if u["name"] == "uav4"],
    )
    assert near(seen[0]["position"], (2.0, 3.0), 1.0)
    served.call("/delete_entity", "simulation_interfaces/srv/DeleteEntity", {"entity": "uav4"})
    page.get_by_role("option", name="uav4").wait_for(state="detached")


# ------------------------------------------------------------------------- attitude and height


def test_the_inspector_shows_attitude_and_height(page, served):
    display = inspect(page, "uav2").get_by_role("img", name="Attitude and height above ground")
    display.wait_for()

    def height(_page):
        return float(display.locator("[data-height]").text_content().removesuffix(" m") or "nan")

    wait_until(page, lambda page: abs(height(page) - HOMES["uav2"][2]) < 0.3)
    turned = display.locator("[data-horizon]").get_attribute("transform")
    roll, nose = (float(value) for value in re.findall(r"(-?[\d.]+)\)", turned.replace("0 ", "")))
    assert abs(roll) < 8.0  # degrees: it holds
    assert abs(nose) < 12.0


# ----------------------------------------------------------------------------- the first frame


@pytest.mark.parametrize("viewport", [WIDE, {"width": 390, "height": 700}])
def test_the_first_image_frames_all_uavs(browsing, served, homes, viewport):
    page = browsing.open(served.url, viewport=viewport)
    page.keyboard.press("m")
    wait_for_world(page)
    wait_for_rest(page)
    box = page.get_by_label("Scene", exact=True).bounding_box()
    seen = np.array([project(page, position_of(served, uav)) for uav in HOMES])
    inside = (seen - (box["x"], box["y"])) / (box["width"], box["height"])
    assert ((inside > 0.0) & (inside < 1.0)).all(), inside
    assert np.ptp(seen[:, 0]) > 0.6 * min(box["width"], box["height"])


# --------------------------------------------------------------------------------- crashes


def test_smoke_rises_from_a_crash(page, served):
    page.get_by_role("option", name="uav2").click()
    put(served, "uav3", 3.0, 2.0, 3.0)  # in the free part of the view
    at = position_of(served, "uav3")
    served.call("/uav3/kill", "std_srvs/srv/Trigger")
    vehicle(served, "uav3", lambda uav: uav["crashed"])
    page.get_by_role("option", name=re.compile("uav3.*crashed", re.DOTALL)).wait_for()
    wait_until(page, lambda page: on_screen(page, "uav3")["position"][2] < at[2] - 1.0)
    x, y = (int(value) for value in project(page, np.add(position_of(served, "uav3"), [0, 0, 1.5])))
    box = {"x": x - 20, "y": y - 20, "width": 40, "height": 40}
    first = page.screenshot(clip=box)
    wait_until(page, lambda page: page.screenshot(clip=box) != first)
    save_screenshot(page, "crash")


def test_a_crashed_uav_is_repaired(page, served):
    served.call("/uav3/kill", "std_srvs/srv/Trigger")
    vehicle(served, "uav3", lambda uav: uav["crashed"])
    repair = inspect(page, "uav3").get_by_role("button", name="Repair and return to start")
    repair.click()
    vehicle(served, "uav3", lambda uav: not uav["crashed"])
    repair.wait_for(state="detached")


# ------------------------------------------------------------------------------- commands


def test_hold_by_key(page, served):
    request = {"position": {"x": 300.0, "y": 0.0, "z": 4.0}, "keep_heading": True}
    served.call("/uav1/go_to", "volery_interfaces/srv/GoTo", request)
    vehicle(served, "uav1", lambda uav: uav["velocity"]["x"] > 1.0)
    page.get_by_role("option", name="uav1").click()
    page.keyboard.press("h")
    held = vehicle(served, "uav1", lambda uav: abs(uav["velocity"]["x"]) < 0.1)
    assert held["position"]["x"] < 290.0  # not where it was sent to
    wait_until(
        page,
        lambda page: near(on_screen(page, "uav1")["position"], position_of(served, "uav1"), 0.5),
    )
