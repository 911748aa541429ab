"""The first visit: `volery serve` without a scenario, and a page without anything kept."""

import re

import pytest
from page_browsing import save_screenshot
from page_serving import Served

from volery.scenario import library
from volery.server.gallery import title_of

pytestmark = pytest.mark.slow

LARGE = {"width": 1440, "height": 900}
PHONE = {"width": 390, "height": 844}
OVERFLOWS = "elements => elements.filter(e => e.scrollWidth > e.clientWidth + 1).length"
CLIPPED = "elements => elements.filter(e => e.scrollHeight > e.clientHeight + 1).length"


@pytest.fixture(scope="module")
def served(chromium):
    with Served(None) as server:
        yield server


def test_the_page_begins_with_the_choice_of_scenarios(browsing, served):
    page = browsing.open(served.url, viewport=LARGE)
    dialog = page.get_by_role("dialog", name="Choose a scenario")
    dialog.wait_for()
    sections = dialog.get_by_role("heading", level=3)
    sections.first.wait_for()
    assert sections.all_inner_texts()[0] == "Start here"
    cards = dialog.locator(".card")
    assert cards.first.get_attribute("aria-label").startswith("hover: First hover. ")
    assert not [title for title in dialog.locator(".card-title").all_inner_texts() if "_" in title]
    assert cards.locator("p").evaluate_all(OVERFLOWS) == 0
    assert cards.locator("p").evaluate_all(CLIPPED) == 0
    save_screenshot(page, "first_visit")
    page.keyboard.press("Escape")
    dialog.wait_for(state="detached")
    page.get_by_role("button", name=re.compile("Scenario hover")).get_by_text(
        "First hover"
    ).wait_for()
    page.reload()  # now the address says what to show
    page.get_by_label("Simulated time").wait_for()
    assert page.get_by_role("dialog").count() == 0


def test_a_link_to_a_view_shows_it_at_once(browsing, served):
    page = browsing.open(served.url + "#view=fly", viewport=LARGE)
    page.get_by_label("Simulated time").wait_for()
    assert page.get_by_role("dialog").count() == 0


def test_a_phone_shows_whole_cards_and_an_empty_plot_with_its_hint_alone(browsing, served):
    page = browsing.open(served.url, viewport=PHONE, is_mobile=True, has_touch=True)
    dialog = page.get_by_role("dialog", name="Choose a scenario")
    cards = dialog.locator(".card")
    cards.first.wait_for()
    assert cards.locator("p").evaluate_all(OVERFLOWS) == 0
    assert dialog.evaluate("e => e.scrollWidth <= e.clientWidth + 1")
    page.keyboard.press("Escape")
    dialog.wait_for(state="detached")
    page.get_by_role("button", name="Plots", exact=True).tap()
    page.get_by_text("Choose a topic and a field below to add a line.").wait_for()
    assert not page.locator("[data-empty] canvas").first.is_visible()
    save_screenshot(page, "phone_empty_plot")


@pytest.mark.parametrize("width", [390, 360])
def test_a_phone_shows_whole_titles_in_two_rows_of_the_top_bar(browsing, served, width):
    """Each shipped title has room beside the buttons, in at most two lines."""
    viewport = {"width": width, "height": 844}
    page = browsing.open(served.url, viewport=viewport, is_mobile=True, has_touch=True)
    title = page.locator(".top-scenario .mantine-Text-root")
    title.wait_for()
    page.get_by_role("group", name="Time").wait_for()
    heights = page.evaluate(
        """titles => {
      const text = document.querySelector(".top-scenario .mantine-Text-root");
      return titles.map((title) => {
        text.textContent = title;
        const isWhole = text.scrollHeight <= text.clientHeight + 1
          && text.scrollWidth <= text.clientWidth + 1;
        return [title, isWhole, document.querySelector(".top").clientHeight];
      });
    }""",
        [title_of(name) for name in library.names()],
    )
    assert len(heights) > 10
    assert [title for title, is_whole, _ in heights if not is_whole] == []
    assert max(height for *_, height in heights) < 90
    save_screenshot(page, f"phone_title_{width}")
