"""Sizes of window, light and dark, and hands that have no mouse."""

import pytest
from page_browsing import keep_picture
from working import tab_to

pytestmark = pytest.mark.slow

SIZES = {"laptop": {"width": 1366, "height": 768}, "phone": {"width": 390, "height": 844}}
PANELS = ("Topics", "Plots", "Services", "Log", "Faults", "Recordings")


def panel_button(page, name):
    return page.get_by_role("navigation").get_by_role("button", name=name, exact=True)


def overflow(page):
    """By how many pixels the page is wider than its window."""
    return page.evaluate("document.documentElement.scrollWidth - window.innerWidth")


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_fits_the_window(browsing, served, size, scheme):
    page = browsing.open(f"{served.url}#quality=minimal", viewport=SIZES[size], color_scheme=scheme)
    page.get_by_label("Simulated time").wait_for()
    assert overflow(page) <= 0
    for name in PANELS if scheme == "light" else ("Topics",):
        panel_button(page, name).click()
        panel = page.get_by_role("complementary", name=name)
        panel.wait_for()
        box = panel.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= SIZES[size]["width"] + 1
        assert box["y"] + box["height"] <= SIZES[size]["height"] + 1
        assert overflow(page) <= 0
        if name in ("Topics", "Plots"):
            page.wait_for_timeout(500)
            keep_picture(page, f"{size}_{scheme}_{name.lower()}")
        panel_button(page, name).click()
    keep_picture(page, f"{size}_{scheme}")


def test_dark_is_dark(browsing, served):
    lightness = {}
    for scheme in ("light", "dark"):
        page = browsing.open(served.url, color_scheme=scheme)
        colour = page.evaluate("getComputedStyle(document.body).backgroundColor")
        channels = colour[colour.index("(") + 1 : -1].split(",")[:3]
        lightness[scheme] = sum(map(float, channels)) / (3 * 255)
    assert lightness["light"] > 0.9
    assert lightness["dark"] < 0.2


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
