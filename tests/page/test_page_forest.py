"""Five thousand trees: few draw calls, and trunks that stop a walker."""

import numpy as np
import pytest
from page_browsing import save_screenshot
from scene_reading import eye, wait_for_frames, wait_for_world, wait_until

from volery.runtime.construction.worlds import build_city, build_forest, build_terrain
from volery.scenario.load import load_scenario

pytestmark = pytest.mark.slow

SCENARIO = "forest_procedural"
MAX_DRAW_CALLS = 250
WITH_TREES = 5000
"""Triangles of a frame, at least, once trees are in it: they come some frames after a jump."""
WALKED_ON = 20
"""Frames, each a step of at most 0.1 s: time enough to pass through a trunk."""
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


@pytest.fixture(scope="module")
def opened(module_browsing, served):
    """One page for all tests, at a quarter of the pixels: what is drawn is the same."""
    look = f"#view=fly&quality=minimal&camera={CAMERAS['minimal'][0]}"
    page = module_browsing.open(served.url + look, viewport=SMALL, device_scale_factor=0.5)
    wait_for_world(page)
    return page


@pytest.fixture
def page(opened, shared):
    return opened


def look_from(page, served, view, quality, camera):
    """Move the camera and draw from there."""
    page.goto(f"{served.url}#view={view}&quality={quality}&camera={camera}")
    axes = 2 if view == "walk" else 3  # a walker's eye is at his own height
    position = [float(number) for number in camera.split("_")[:axes]]
    wait_until(page, lambda page: np.allclose(eye(page)[:axes], position, atol=0.1))
    wait_until(page, lambda page: page.evaluate("window.volery.quality") == quality)
    wait_for_frames(page, 3)


def test_a_walker_is_stopped_by_a_trunk(page, served, forest):
    at, radius = thick_trunk(forest)
    x, y, z = at
    look_from(page, served, "walk", "minimal", f"{x - 2.0}_{y}_{z}_0_0_0")
    page.get_by_label("Scene", exact=True).locator("canvas").focus()
    page.keyboard.down("KeyW")
    gaps = []

    def walk(page):
        wait_for_frames(page, 1)
        gaps.append(float(np.hypot(*(eye(page)[:2] - at[:2]))))
        return gaps[-1] < radius + 1.0

    wait_until(page, walk)  # he has come to it ...
    for _ in range(WALKED_ON):
        walk(page)
    page.keyboard.up("KeyW")
    assert min(gaps) > radius + 0.1  # ... and was not let in


@pytest.mark.parametrize("quality", CAMERAS)
def test_draw_calls_of_five_thousand_trees(page, served, forest, quality):
    assert len(forest.position_map) >= 5000
    for camera in CAMERAS[quality]:
        look_from(page, served, "fly", quality, camera)
        wait_until(page, lambda page: page.evaluate("window.volery.triangles") > WITH_TREES)
        wait_for_frames(page, 3)
        save_screenshot(page, f"forest_{quality}_{camera.split('_')[2]}")
        assert 0 < page.evaluate("window.volery.drawCalls") <= MAX_DRAW_CALLS


def thick_trunk(forest):
    """Place and radius at breast height of a thick trunk with no other near."""
    positions = np.asarray(forest.position_map)
    dbh = np.array([forest.models[k].dbh_m for k in forest.model_index])
    radii = 0.5 * dbh * np.asarray(forest.scale)[:, 0]
    for tree in np.argsort(-radii):
        others = np.hypot(*(positions[:, :2] - positions[tree, :2]).T)
        if np.sort(others)[1] > 3.0:
            return positions[tree], float(radii[tree])
    raise AssertionError("no trunk stands alone")
