"""A recorded flight with cameras: each image once, and recording is not what takes the time."""

import time

import pytest

from volery import Simulation, load_scenario
from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.reader import summarize
from volery.bridges.logs.recorded_topics import recorded_topics
from volery.publishing.camera_publishing import CameraPublisher

pytestmark = pytest.mark.slow
MAX_FRACTION = 1.0 / 3.0
"""Of the run's processor time, at most for making messages of images and writing the log."""


class Timer:
    """Sums up the processor time of a function."""

    def __init__(self):
        self.spent_s = 0.0

    def of(self, function):
        def timed(*arguments):
            begun_s = time.thread_time()
            try:
                return function(*arguments)
            finally:
                self.spent_s += time.thread_time() - begun_s

        return timed


def test_each_image_is_recorded_once_and_cheaply(tmp_path, monkeypatch):
    timer = Timer()
    monkeypatch.setattr(CameraPublisher, "publish", timer.of(CameraPublisher.publish))
    path = tmp_path / "flight.mcap"
    with Simulation(load_scenario("forest_cameras")) as simulation:
        matches = recorded_topics(simulation.graph)
        log = create_log(path)
        simulation.graph.subscribe_all(timer.of(log.write), matches)
        begun_s = time.process_time()
        simulation.run(1.0)
        total_s = time.process_time() - begun_s
        log.close()
        rates = simulation.diagnostics.image_rates
    assert timer.spent_s < MAX_FRACTION * total_s
    front = {
        topic.topic.removeprefix("/uav1/front/")
        for topic in summarize(path).topics
        if topic.topic.startswith("/uav1/front/")
    }
    assert front == {
        *("camera_info", "image_raw/compressed", "depth", "labels/instance", "labels/material")
    }
    expected = sum(rate for topic, rate in rates.items() if matches(topic))
    assert 0.3 * expected < path.stat().st_size < 3.0 * expected
