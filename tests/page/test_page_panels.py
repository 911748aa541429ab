"""Two bottom panels, plots of one field over another one, and a UAV that returns to its start."""

import json
import re

import pytest
from page_browsing import save_screenshot
from truth import hurried, until, vehicle
from working import WIDE, choose_field, open_panel, panel_button

pytestmark = pytest.mark.slow

ABOVE = "x: /uav1/odom.pose.pose.position.x, y: /uav1/odom.pose.pose.position.y"
PHONE = {"width": 390, "height": 844}
MIN_HALF_PX = 300
SENT_TO = {"x": 6.0, "y": 3.0, "z": 4.0}


@pytest.fixture(scope="module")
def served(chromium):
    from page_serving import Served

    with Served("hover", "--uavs", "2") as server:
        yield server


@pytest.fixture(scope="module")
def opened(module_browsing, served):
    return module_browsing.open(served.url + "#uav=uav1", viewport=WIDE)


@pytest.fixture
def page(opened, shared):
    return opened


def box(element):
    found = element.bounding_box()
    return found["x"], found["x"] + found["width"], found["width"]


def send_away(served, **changed):
    """Have uav1 fly to `SENT_TO`, and wait until it is nearly there."""
    request = {"position": {**SENT_TO, **changed}}
    assert served.call("/uav1/go_to", "volery_interfaces/srv/GoTo", request)["success"]
    x = request["position"]["x"]
    vehicle(served, "uav1", lambda uav: abs(uav["position"]["x"] - x) < 0.5)


def test_two_panels_lie_side_by_side(page):
    plots = open_panel(page, "Plots")
    plots.get_by_role("button", name="Show a second panel beside Plots").click()
    topics = page.get_by_role("complementary", name="Topics")
    topics.get_by_label("Filter topics").wait_for()
    (left, border, width), (start, right, other) = box(plots), box(topics)
    assert border == pytest.approx(start, abs=1)
    assert width == pytest.approx(other, abs=2)
    assert left >= 0
    assert right <= WIDE["width"] + 1
    edge = page.get_by_role("separator", name="Border of Plots and Topics")
    edge.press("ArrowLeft")
    assert box(plots)[2] < width - 30
    grip = edge.bounding_box()
    page.mouse.move(grip["x"] + 3, grip["y"] + 60)
    page.mouse.down()
    page.mouse.move(WIDE["width"], grip["y"] + 60, steps=3)
    page.mouse.up()
    assert box(topics)[2] == pytest.approx(MIN_HALF_PX, abs=2)
    topics.get_by_role("button", name="Topics: show another panel").click()
    page.get_by_role("menuitem", name="Log", exact=True).click()
    page.get_by_role("complementary", name="Log").wait_for()
    assert panel_button(page, "Log").get_attribute("aria-pressed") == "true"
    kept = json.loads(page.evaluate("localStorage.getItem('volery.layout')"))
    assert [kept["bottom"], kept["second"]] == ["plots", "log"]
    panel_button(page, "Log").click()
    until(lambda: box(plots)[2] > 0.9 * WIDE["width"])


def curve_to(page, plots, x):
    """(x, y) of the first curve, as the plots' file has it, once it reaches x; None before."""
    with page.expect_download() as kept:
        plots.get_by_role("button", name="Download as CSV").click()
    head, *rows = kept.value.path().read_text().splitlines()
    assert head.split(",")[:3] == [
        "time_s",
        "/uav1/odom.pose.pose.position.x",
        "/uav1/odom.pose.pose.position.y",
    ]
    flown = [tuple(map(float, cells[1:3])) for row in rows if (cells := row.split(","))[1]]
    return flown if flown[-1][0] > x else None


def test_a_field_is_plotted_over_another_one(page, served):
    plots = open_panel(page, "Plots")
    plots.get_by_role("button", name="x-y plot").click()  # begins with the selected UAV from above
    plots.locator(f"[data-line='{ABOVE}']").wait_for()
    plots.get_by_role("button", name="Curve").click()
    form = page.get_by_role("form", name="New curve")
    choose_field(page, "Topic of x", "/uav1/odom")
    choose_field(page, "Field of x", "pose.pose.position.x")
    choose_field(page, "Field of y", "pose.pose.position.y")
    form.get_by_label("All 2 UAVs").check()
    form.get_by_role("button", name="Add", exact=True).click()
    other = plots.locator("[data-line^='x: /uav2/odom']")
    until(lambda: re.search(r"-?\d+\.\d+, -?\d+\.\d+$", other.inner_text()))
    same = plots.get_by_role("button", name="Same scale on both axes")
    assert same.get_attribute("aria-pressed") == "true"
    with hurried(served):
        send_away(served)
    save_screenshot(page, "plots_xy")
    flown = until(lambda: curve_to(page, plots, SENT_TO["x"] - 1.0))
    assert flown[0] == pytest.approx((0.0, 0.0), abs=0.5)
    saved = json.loads(page.evaluate("localStorage.getItem('volery.plots')"))["plots"]
    assert len(saved[-1]["curves"]) == 2


def test_a_uav_that_returns_to_its_start_leaves_no_trail(page, served):
    length = "window.volery.trailLength('uav1')"
    for x in (6.0, 9.0, 6.0, 9.0):  # few frames are drawn where WebGL is slow
        send_away(served, x=x)
        if page.evaluate(length) > 0:
            break
    assert page.evaluate(length) > 0
    response = served.call("/volery/reset_uav", "volery_interfaces/srv/ByName", {"name": "uav1"})
    assert response["success"], response
    until(lambda: page.evaluate(length) == 0)


def test_the_window_of_scenarios_takes_every_file(page):
    page.get_by_label("choose another scenario").click()
    with page.expect_file_chooser() as chosen:
        page.get_by_role("button", name="Upload a file").click()
    chosen.value.set_files({"name": "flight.mcap", "mimeType": "", "buffer": b"\x89MCAP0\r\n"})
    dialog = page.get_by_role("dialog", name="Upload a map, a scenario or a log")
    until(lambda: dialog.get_by_role("radio", name="Log").is_checked())
    save_screenshot(page, "upload")


def test_a_phone_shows_one_bottom_panel(page):
    page.set_viewport_size(WIDE)
    plots = open_panel(page, "Plots")
    plots.get_by_role("button", name="Show a second panel beside Plots").click()
    page.get_by_role("complementary", name="Topics").wait_for()
    page.set_viewport_size(PHONE)
    page.get_by_role("complementary", name="Topics").wait_for(state="detached")
    assert plots.is_visible()
    assert plots.get_by_role("button", name="Show a second panel beside Plots").count() == 0
    services = open_panel(page, "Services")
    plots.wait_for(state="detached")
    name = services.get_by_role("button", name="/uav1/go_to", exact=True)
    name.wait_for()
    assert name.evaluate("element => element.scrollWidth <= element.clientWidth + 1")
    assert name.bounding_box()["width"] > 250
    toolbar = page.get_by_role("button", name="Layers").bounding_box()
    assert page.get_by_role("group", name="Map", exact=True).bounding_box()["y"] > toolbar["y"] + 20
    save_screenshot(page, "phone_services")
