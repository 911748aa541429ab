"""Hands on the page: what many tests press, choose and pull."""

from __future__ import annotations

WIDE = {"width": 1000, "height": 600}
SMALL = {"width": 760, "height": 430}
"""Software draws WebGL as slowly as there are pixels."""


def open_panel(page, name):
    """The panel's own part of the page."""
    panel = page.get_by_role("complementary", name=name)
    if not panel.is_visible():
        page.get_by_role("navigation").get_by_role("button", name=name, exact=True).click()
    return panel


def panel_button(page, name):
    """The button of the rail that opens a panel."""
    return page.get_by_role("navigation").get_by_role("button", name=name, exact=True)


def choose_field(page, name, option):
    """Search a long list and choose from it."""
    field = page.get_by_role("combobox", name=name, exact=True)
    field.click()
    field.fill(option)
    page.get_by_role("option", name=option, exact=True).click()


def inspect(page, uav):
    """The inspector with this UAV selected."""
    page.get_by_role("option", name=uav).click()
    return open_panel(page, "Inspector")


def set_slider(page, name, key, times=1):
    """Press a key on a slider, so many times."""
    slider = page.get_by_role("slider", name=name, exact=True)
    slider.focus()
    for _ in range(times):
        slider.press(key)


def choose(page, field, option):
    """Choose from a list that unfolds; `field` is its locator."""
    field.click()
    page.get_by_role("option", name=option, exact=True).click()


def pull(page, start, end, steps=8):
    """Drag with the left button, in CSS pixels of the window."""
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*end, steps=steps)
    page.mouse.up()


def tab_to(page, element, max_tabs=60):
    """Give the keyboard to an element as a hand without a mouse does."""
    for _ in range(max_tabs):
        if element.evaluate("element => element === document.activeElement"):
            return
        page.keyboard.press("Tab")
    raise AssertionError(f"{element} cannot be reached by Tab")


def press_canvas(page):
    """Give the keyboard to the scene, so that views receive the keys."""
    page.get_by_label("Scene", exact=True).locator("canvas").focus()
