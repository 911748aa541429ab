"""Sizes of window, light and dark, and hands that have no mouse."""

import pytest
from page_browsing import save_screenshot
from scene_reading import wait_until
from working import tab_to

pytestmark = pytest.mark.slow

DESKTOP = {"width": 1440, "height": 900}
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
    save_screenshot(page, f"{size}_light")
    page.emulate_media(color_scheme="dark")
    wait_until(page, lambda page: lightness(page) < 0.2)
    assert overflow(page) <= 0
    fits_with(page, "Topics", SIZES[size], f"{size}_dark")
    save_screenshot(page, f"{size}_dark")


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
        save_screenshot(page, f"{kept}_{name.lower()}")
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


# --------------------------------------------------------------------- nothing is cut or covered


def clipped(page):
    """Labels of buttons that are wider than their buttons show."""
    return page.evaluate("""[...document.querySelectorAll(".mantine-Button-label")]
        .filter((label) => label.scrollWidth > label.clientWidth + 1)
        .map((label) => label.textContent)""")


def is_on_top(page, element):
    """Whether the middle and both ends of an element can be clicked."""
    box = element.bounding_box()
    y = box["y"] + box["height"] / 2
    return all(
        element.evaluate("(element, [x, y]) => element.contains(document.elementFromPoint(x, y))",
                         [x, y])
        for x in (box["x"] + 6, box["x"] + box["width"] / 2, box["x"] + box["width"] - 6)
    )  # fmt: skip


def test_labels_are_whole_and_the_prompt_lies_free(browsing, served):
    page = browsing.open(served.url + "#uav=uav1", viewport=DESKTOP)
    page.get_by_role("button", name="Reset", exact=True).click()
    page.get_by_role("button", name="New seed").wait_for()
    assert clipped(page) == []
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Add UAVs").click()
    page.get_by_role("button", name="Click position").wait_for()
    assert clipped(page) == []
    panel_button(page, "Inspector").click()
    page.get_by_label("Go to a clicked position").click()
    prompt = page.get_by_role("status").filter(has_text="Goal of uav1")
    prompt.wait_for()
    assert clipped(page) == []
    assert is_on_top(page, prompt)
    prompt.get_by_role("button", name="Cancel (Esc)").click()
    prompt.wait_for(state="detached")


def test_a_saved_layout_is_restored(browsing, served):
    page = browsing.open(served.url, viewport={"width": 1000, "height": 600})
    panel_button(page, "Plots").click()
    page.get_by_role("button", name="Layouts").click()
    page.get_by_label("Name of the layout").fill("tuning")
    page.get_by_role("button", name="Save", exact=True).click()
    page.get_by_role("button", name="Restore tuning").wait_for()
    page.keyboard.press("Escape")
    panel_button(page, "Plots").click()
    plots = page.get_by_role("complementary", name="Plots")
    plots.wait_for(state="detached")
    page.get_by_role("button", name="Layouts").click()
    page.get_by_role("button", name="Restore tuning").click()
    plots.wait_for()


# ------------------------------------------------------------------------------ a phone's sheet


def drag(page, element, to_y):
    box = element.bounding_box()
    x = box["x"] + box["width"] / 2
    page.mouse.move(x, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(x, to_y, steps=4)
    page.mouse.up()


def test_panels_of_a_phone_leave_half_of_the_page_to_the_scene(browsing, served):
    size = SIZES["phone"]
    page = browsing.open(served.url + "#uav=uav1", viewport=size)
    panel_button(page, "Inspector").click()
    panel = page.get_by_role("complementary", name="Inspector")
    handle = page.get_by_role("separator", name="Height of Inspector")
    handle.wait_for()
    drag(page, handle, 0)
    half = size["height"] / 2
    assert panel.bounding_box()["height"] == pytest.approx(half, abs=1)
    scene = page.get_by_role("main").bounding_box()
    assert scene["y"] + scene["height"] == pytest.approx(half, abs=1)
    assert scene["height"] > 0.35 * size["height"]
    save_screenshot(page, "phone_sheet")
    drag(page, handle, size["height"] - 200)
    assert panel.bounding_box()["height"] == pytest.approx(200, abs=12)
    drag(page, handle, size["height"] - 5)
    panel.wait_for(state="detached")
