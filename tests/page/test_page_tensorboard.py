"""TensorBoard inside the page, for the trainings of a folder."""

import pytest
from page_browsing import save_screenshot
from page_serving import Served
from working import open_panel, panel_button

pytestmark = pytest.mark.slow

STEPS = 20
TALL = {"width": 1200, "height": 1000}
HIGH_PANEL = """localStorage.setItem("volery.layout", JSON.stringify(
    {left: "", sizes: {left: 270, right: 330, bottom: 600}}))"""


@pytest.fixture(scope="module")
def trainings(tmp_path_factory):
    """A folder with the curve of a training."""
    writing = pytest.importorskip("tensorboard.summary.writer.event_file_writer")
    from tensorboard.compat.proto.event_pb2 import Event
    from tensorboard.compat.proto.summary_pb2 import Summary

    folder = tmp_path_factory.mktemp("training")
    writer = writing.EventFileWriter(str(folder / "hover"))
    for step in range(STEPS):
        value = Summary.Value(tag="evaluation/success", simple_value=step / STEPS)
        writer.add_event(Event(step=step, wall_time=1.0 + step, summary=Summary(value=[value])))
    writer.close()
    return folder


@pytest.fixture(scope="module")
def served_with_tensorboard(trainings, chromium):
    """A server that shows them; it outlives the test's pages, which would miss it."""
    options = ("--viewer-token", "viewers", "--tensorboard", str(trainings))
    with Served("hover", *options, token="operators") as server:
        yield server


def test_the_panel_shows_curves_to_viewers(browsing, served_with_tensorboard):
    browsing.expected.append("font-roboto")  # TensorBoard's address is absolute: another font
    url = f"{served_with_tensorboard.url}?token=viewers"
    page = browsing.open(url, viewport=TALL, init_script=HIGH_PANEL)
    with page.expect_response(lambda response: "/timeSeries?" in response.url) as series:
        frame = open_panel(page, "TensorBoard").frame_locator("iframe")
        frame.locator("scalar-card").first.scroll_into_view_if_needed()
    (curve,) = series.value.json()
    assert len(curve["runToSeries"]["hover"]) == STEPS
    frame.locator("scalar-card line-chart").first.wait_for()
    frame.get_by_text("evaluation/success").first.wait_for()
    page.mouse.move(10, 10)
    save_screenshot(page, "tensorboard")


def test_without_a_tensorboard_there_is_no_panel(browsing, served):
    page = browsing.open(served.url)
    panel_button(page, "Policy").wait_for()
    assert panel_button(page, "TensorBoard").count() == 0
