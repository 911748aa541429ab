"""The page where a scenario ends: it says so, and what it offers works."""

import pytest
from page_browsing import keep_picture
from page_serving import Served
from truth import until
from working import SMALL

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

END_S = 3.0
LOOK = "#quality=minimal"


@pytest.fixture(scope="module")
def served(chromium):
    with Served("hover", "--seconds", str(END_S)) as server:
        yield server


@pytest.fixture
def banner(browsing, served):
    page = browsing.open(served.url + LOOK, viewport=SMALL)
    banner = page.get_by_role("status").filter(has_text="Scenario ended")
    banner.wait_for(timeout=120_000)
    return banner


def time_s(served):
    stamp = served.once("/volery/status", "volery_interfaces/SimulationStatus")["stamp"]
    return stamp["sec"] + 1e-9 * stamp["nanosec"]


def test_a_reset_flies_again_and_fly_on_passes_the_end(banner, served):
    assert served.status()["state"] == "ended"
    assert "0:03.0" in banner.inner_text()
    keep_picture(banner.page, "end")
    banner.get_by_role("button", name="Reset").click()
    until(lambda: served.status()["state"] == "flying", 60)
    assert time_s(served) < END_S
    banner.wait_for(state="detached", timeout=60_000)
    banner.wait_for(timeout=120_000)
    banner.get_by_role("button", name="Continue").click()
    banner.wait_for(state="detached", timeout=60_000)
    until(lambda: time_s(served) > END_S + 1.0, 60)
    assert served.status()["state"] == "flying"
