"""Sizes of window, light and dark, and hands that have no mouse."""

import pytest
from page_browsing import keep_picture
from scene_reading import wait_until
from working import tab_to

pytestmark = pytest.mark.slow

SIZES = {"laptop": {"width": 1366, "height": 768}, "phone": {"width": 390, "height": 844}}
PANELS = ("Topics", "Plots", "Services", "Log", "Faults", "Recordings")


def panel_button(page, name):
    return page.get_by_role("navigation").get_by_role("button", name=name, exact=True)


def overflow(page):
    """By how many pixels the page is wider than its window."""
    return page.evaluate("document.documentElement.scrollWidth - window.innerWidth")


def lightness(page):
    """Of the page behind all else, 0 to 1."""
    colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
    channels = colour[colour.index("(") + 1 : -1].split(",")[:3]
    return sum(map(float, channels)) / (3 * 255)


@pytest.mark.parametrize("size", SIZES)
def test_fits_the_window_light_and_dark(browsing, served, size):
    page = browsing.open(
        f"{served.url}#quality=minimal", viewport=SIZES[size], color_scheme="light"
    )
    page.get_by_label("Simulated time").wait_for()
    assert lightness(page) > 0.9
    assert overflow(page) <= 0
    for name in PANELS:
        fits_with(page, name, SIZES[size], f"{size}_light")
    keep_picture(page, f"{size}_light")
    page.emulate_media(color_scheme="dark")
    wait_until(page, lambda page: lightness(page) < 0.2)
    assert overflow(page) <= 0
    fits_with(page, "Topics", SIZES[size], f"{size}_dark")
    keep_picture(page, f"{size}_dark")


def fits_with(page, name, size, kept):
    """The panel opens within the window, and closes."""
    panel_button(page, name).click()
    panel = page.get_by_role("complementary", name=name)
    panel.wait_for()
    box = panel.bounding_box()
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= size["width"] + 1
    assert box["y"] + box["height"] <= size["height"] + 1
    assert overflow(page) <= 0
    if name in ("Topics", "Plots"):
        page.wait_for_timeout(500)
        keep_picture(page, f"{kept}_{name.lower()}")
    panel_button(page, name).click()


def test_panels_work_by_keyboard_alone(browsing, served):
    page = browsing.open(served.url, viewport={"width": 1000, "height": 600})
    panel_button(page, "Topics").focus()
    page.keyboard.press("Enter")
    filter_ = page.get_by_label("Filter topics")
    filter_.wait_for()
    tab_to(page, filter_)
    page.keyboard.type("uav1/odom")
    row = page.get_by_role("listitem", name="/uav1/odom", exact=True)
    row.wait_for()
    page.keyboard.press("Tab")  # to the tick
    page.keyboard.press("Tab")  # to the name
    page.keyboard.press("Enter")
    row.locator("[data-path='pose.pose.position.z']").wait_for()
