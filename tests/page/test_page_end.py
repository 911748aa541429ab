"""The page where a scenario ends: it says so, and what it offers works."""

import pytest
from page_browsing import save_screenshot
from page_serving import Served
from truth import collect_statuses, first_after_return, set_speed, stamp_ns, status, until
from working import SMALL

pytestmark = pytest.mark.slow

END_NS = 3_000_000_000
SLOW, UNBOUNDED = 0.1, 0.0
LOOK = "#quality=minimal"


@pytest.fixture(scope="module")
def served(chromium):
    with Served("hover", "--seconds", "3", "--speed", str(SLOW)) as server:
        yield server


@pytest.fixture
def banner(browsing, served):
    set_speed(served, UNBOUNDED)
    page = browsing.open(served.url + LOOK, viewport=SMALL)
    banner = page.get_by_role("status").filter(has_text="Scenario ended")
    banner.wait_for()
    return banner


def test_a_reset_flies_again_and_fly_on_passes_the_end(banner, served):
    assert served.status()["state"] == "ended"
    assert "0:03.0" in banner.inner_text()
    save_screenshot(banner.page, "end")
    set_speed(served, SLOW)  # so that nothing below comes after the next end
    with collect_statuses(served) as received:
        banner.get_by_role("button", name="Reset").click()
        started = until(lambda: first_after_return(received))
    assert stamp_ns(started) < END_NS
    assert served.status()["state"] == "flying"
    banner.wait_for(state="detached")
    set_speed(served, UNBOUNDED)
    banner.wait_for()
    banner.get_by_role("button", name="Continue").click()
    banner.wait_for(state="detached")
    status(served, lambda message: stamp_ns(message) > END_NS + 1_000_000_000)
    assert served.status()["state"] == "flying"
