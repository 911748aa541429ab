"""Recordings by name, and what stood where they were flown."""

import pytest

from volery.core.errors import RecordingError
from volery.runtime import Simulation
from volery.runtime.recorded import geometry_of, recording_named
from volery.scenario.load import parse_scenario


def test_a_log_of_the_folder_is_found(tmp_path):
    log = tmp_path / "flight.mcap"
    log.write_bytes(b"")
    assert recording_named(tmp_path, "flight.mcap") == log


@pytest.mark.parametrize(
    "name", ["../flight.mcap", "other.mcap", "notes.txt", "", ".", "link.mcap"]
)
def test_nothing_else_is(tmp_path, name):
    inside = tmp_path / "logs"
    inside.mkdir()
    for path in (tmp_path / "flight.mcap", inside / "notes.txt"):
        path.write_bytes(b"")
    (inside / "link.mcap").symlink_to(tmp_path / "flight.mcap")
    with pytest.raises(RecordingError, match="there is no recording"):
        recording_named(inside, name)


def test_without_a_folder_there_is_none():
    with pytest.raises(RecordingError, match="--recordings"):
        recording_named(None, "flight.mcap")


def test_geometry_is_that_of_the_flight(wood_data):
    """The same id as of the simulation, so a browser that has the world need not fetch it again."""
    scenario = parse_scenario(wood_data)
    with Simulation(scenario, threads=1) as simulation:
        assert geometry_of(scenario).id == simulation.geometry.id
