"""Five thousand trees: few draw calls, and trunks that stop a walker."""

import numpy as np
import pytest
from page_browsing import keep_picture
from scene_reading import eye, wait_for_frames, wait_for_picture, wait_until

from volery.runtime.build.worlds import build_city, build_forest, build_terrain
from volery.scenario.load import load_scenario

pytestmark = pytest.mark.slow

SCENARIO = "forest_procedural"
MOST_DRAW_CALLS = 250
SMALL = {"width": 480, "height": 270}
CAMERAS = {
    "minimal": ("250_250_2_0.5_0_0", "250_250_30_2_-0.4_0", "-60_250_80_0_-0.3_0"),
    "medium": ("250_250_2_0.5_0_0",),  # shadows cost software half a minute a view
}


@pytest.fixture(scope="module")
def forest():
    scenario = load_scenario(SCENARIO)
    terrain = build_terrain(scenario)
    return build_forest(scenario, terrain, build_city(scenario, terrain))


@pytest.mark.parametrize("quality", CAMERAS)
def test_draw_calls_of_five_thousand_trees(browsing, served, forest, quality):
    assert len(forest.position_map) >= 5000
    page = None
    for camera in CAMERAS[quality]:
        url = f"{served.url}#view=fly&quality={quality}&camera={camera}"
        if page is None:
            page = browsing.open(url, viewport=SMALL)
            wait_for_picture(page)
        else:
            page.goto(url)
        place = [float(number) for number in camera.split("_")[:3]]
        wait_until(page, lambda page, place=place: np.allclose(eye(page), place, atol=0.1))
        wait_for_frames(page, 3)
        told = page.evaluate("window.volery")
        keep_picture(page, f"forest_{quality}_{camera.split('_')[2]}")
        assert 0 < told["drawCalls"] <= MOST_DRAW_CALLS
        assert told["triangles"] > 5000  # trees are in it


def test_a_walker_is_stopped_by_a_trunk(browsing, served, forest):
    at, radius = thick_trunk(forest)
    x, y, z = at
    page = browsing.open(
        f"{served.url}#view=walk&quality=minimal&camera={x - 2.0}_{y}_{z}_0_0_0", viewport=SMALL
    )
    wait_for_picture(page)
    wait_for_frames(page, 5)
    page.get_by_label("Scene", exact=True).locator("canvas").focus()
    page.keyboard.down("KeyW")
    gaps = []
    for _ in range(60):
        wait_for_frames(page, 1)
        gaps.append(float(np.hypot(*(eye(page)[:2] - at[:2]))))
    page.keyboard.up("KeyW")
    assert min(gaps) < radius + 1.0  # he has come to it ...
    assert min(gaps) > radius + 0.1  # ... and was not let in


def thick_trunk(forest):
    """Place and radius at breast height of a thick trunk with no other near."""
    places = np.asarray(forest.position_map)
    dbh = np.array([forest.models[k].dbh_m for k in forest.model_index])
    radii = 0.5 * dbh * np.asarray(forest.scale)[:, 0]
    for tree in np.argsort(-radii):
        others = np.hypot(*(places[:, :2] - places[tree, :2]).T)
        if np.sort(others)[1] > 3.0:
            return places[tree], float(radii[tree])
    raise AssertionError("no trunk stands alone")
