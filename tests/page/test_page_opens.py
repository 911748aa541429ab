"""The page opens, shows a flight and steers it."""

from page_browsing import save_screenshot

PAUSED = 2


def test_page_shows_the_flight_and_pauses_it(page, served):
    clock = page.get_by_label("Simulated time")
    clock.wait_for()
    save_screenshot(page, "opens")
    page.get_by_role("button", name="Pause", exact=True).click()
    page.get_by_role("button", name="Play", exact=True).wait_for()
    response = served.call("/get_simulation_state", "simulation_interfaces/srv/GetSimulationState")
    assert response["state"]["state"] == PAUSED
    page.get_by_role("button", name="Play", exact=True).click()
    page.get_by_role("button", name="Pause", exact=True).wait_for()
