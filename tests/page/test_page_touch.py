"""A phone: sticks under two thumbs fly a UAV."""

import pytest
from page_browsing import save_screenshot
from scene_reading import on_screen, wait_until
from truth import hurried, position_of, vehicle

pytestmark = pytest.mark.slow

PHONE = {"width": 390, "height": 844}
TOUCH = {"is_mobile": True, "has_touch": True, "device_scale_factor": 2}
RADIUS_PX = 56


class Thumbs:
    """Fingers on the screen of a page, each by its own number."""

    def __init__(self, page):
        self._devtools = page.context.new_cdp_session(page)
        self._positions = {}

    def put(self, finger, x, y):
        """Lay a finger down, or move it."""
        kind = "touchMove" if finger in self._positions else "touchStart"
        self._positions[finger] = (x, y)
        self._dispatch(kind, self._positions)

    def lift(self, finger):
        self._dispatch("touchEnd", {finger: self._positions.pop(finger)})

    def _dispatch(self, kind, positions):
        points = [{"x": x, "y": y, "id": id_} for id_, (x, y) in positions.items()]
        self._devtools.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


@pytest.fixture
def page(browsing, served):
    with hurried(served):
        vehicle(served, "uav1", lambda uav: uav["mode"] == "HOLD")  # after its own take-off
    page = browsing.open(served.url + "#uav=uav1", viewport=PHONE, **TOUCH)
    page.get_by_role("button", name="Manual control").tap()
    return page


def middle(element):
    box = element.bounding_box()
    assert box["width"] == pytest.approx(2 * RADIUS_PX, abs=1)
    return box["x"] + RADIUS_PX, box["y"] + RADIUS_PX


def test_two_thumbs_fly_a_uav(page, served):
    hands = page.get_by_role("group", name="Manual control")
    left = page.get_by_role("application", name="Climb / yaw")
    right = page.get_by_role("application", name="Forward / lateral")
    left.wait_for()
    panel = hands.bounding_box()
    (lx, ly), (rx, ry) = middle(left), middle(right)
    assert panel["y"] + panel["height"] <= min(ly, ry) - RADIUS_PX  # nothing lies under a thumb
    assert max(ly, ry) + RADIUS_PX <= PHONE["height"]
    assert rx - lx > 2 * RADIUS_PX
    x, _, z = position_of(served, "uav1")
    thumbs = Thumbs(page)
    thumbs.put(1, rx, ry)
    thumbs.put(1, rx, ry - 0.9 * RADIUS_PX)  # ahead
    vehicle(served, "uav1", lambda uav: uav["velocity"]["x"] > 1.0 and uav["mode"] == "VELOCITY")
    thumbs.put(2, lx, ly)
    thumbs.put(2, lx, ly - 3.0 * RADIUS_PX)  # and up, further than the stick goes
    both = vehicle(
        served, "uav1", lambda uav: uav["velocity"]["z"] > 0.7 and uav["velocity"]["x"] > 1.0
    )
    assert both["velocity"]["z"] < 2.0  # full speed and no more
    save_screenshot(page, "phone_sticks")
    thumbs.lift(1)  # the other thumb stays
    vehicle(
        served, "uav1", lambda uav: abs(uav["velocity"]["x"]) < 0.3 and uav["velocity"]["z"] > 0.7
    )
    thumbs.lift(2)
    vehicle(served, "uav1", lambda uav: abs(uav["velocity"]["z"]) < 0.2)
    flown = position_of(served, "uav1")
    assert flown[0] > x + 1.0
    assert flown[2] > z + 0.5
    wait_until(page, lambda page: on_screen(page, "uav1")["position"][2] > z + 0.5)
    page.get_by_label("Release the controls").tap()
    right.wait_for(state="detached")
