"""A world of blocks whose map, height and size change while UAVs fly and measure in it."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from service_calls import call_service, request_of

from volery.core.errors import CommandError, DataFileError, PlacementError, ScenarioError
from volery.engine.events import EventKind
from volery.graph.messages import (
    Header,
    MapMetaData,
    OccupancyGrid,
    Point,
    Pose,
    Quaternion,
    time_from_ns,
)
from volery.runtime.services.grid_maps import grid_of

SCAN = "/uav1/laser/horizontal/scan"
FIRST_WALL_M, TALL_M, LOW_M = 6.0, 6.0, 1.0


@pytest.fixture
def blocks_data(tmp_path):
    """A hovering UAV with a level LIDAR, and two maps: a wall ahead of it, and one farther away."""
    near, far = tmp_path / "near.csv", tmp_path / "far.csv"
    near.write_text("\n".join(["0,0,1"] * 7))
    far.write_text("\n".join(["0,0,0,0,1"] * 7))
    return {
        "name": "blocks",
        "world": {
            "grid_map": {
                "maps": [{"file": str(near)}, {"file": str(far), "name": "far"}],
                "cell_size_m": 3.0,
                "block_height_m": TALL_M,
                "origin_m": [0.0, -10.5],
            }
        },
        "types": {
            "f450": {
                "plant": "kinematic",
                "sensors": [
                    {"kind": "lidar", "noise": False},
                    {"kind": "imu"},
                    {"kind": "ground_truth"},
                ],
            }
        },
        "uavs": [{"type": "f450", "position_m": [0.0, 0.0, 2.0]}],
    }


class Ahead:
    """Straight ahead, what each scan of uav1 met, and when it was published."""

    def __init__(self, simulation):
        self.ranges, self.times_ns = [], []
        simulation.graph.subscribe(SCAN, self._take)

    def _take(self, published):
        ranges = np.asarray(published.message.ranges)
        self.ranges.append(float(ranges[len(ranges) // 2]))
        self.times_ns.append(published.time_ns)


def test_the_next_scan_sees_the_change(simulate, blocks_data):
    simulation = simulate(blocks_data)
    ahead = Ahead(simulation)
    simulation.run(0.2)
    assert ahead.ranges[-1] == pytest.approx(FIRST_WALL_M, abs=1e-3)
    for change, want in (
        ({"block_height_m": LOW_M}, np.inf),
        ({"block_height_m": 3.0}, FIRST_WALL_M),
        ({"cell_size_m": 4.0}, 8.0),
        ({"name": "far"}, 12.0),
        ({"name": "near"}, 8.0),
        ({"name": "far", "cell_size_m": 2.0, "block_height_m": 2.5}, 8.0),
    ):
        simulation.world.grid_map.change(**change)
        seen = len(ahead.ranges)
        simulation.run(0.025)  # one scan
        assert len(ahead.ranges) == seen + 1
        assert ahead.ranges[-1] == pytest.approx(want, abs=1e-3), change
    events = [event for event in simulation.diagnostics.events if event.kind is EventKind.WORLD]
    assert len(events) == 6
    assert "'far', 5 x 7 cells of 2 m, blocks 2.5 m high" in events[-1].describe()


def test_runs_with_changes_are_the_same_twice_and_from_slices(simulate, blocks_data):
    def fly(step):
        simulation = simulate(blocks_data)
        simulation.diagnostics.enable_digest()
        while simulation.time_ns < 600_000_000:
            at_ms = simulation.time_ns // 1_000_000
            if at_ms == 200:
                simulation.world.grid_map.change("far", block_height_m=3.0)
            if at_ms == 400:
                simulation.graph.call("/volery/set_grid_map", set_request(simulation, "near"))
            simulation.step(step)
        return simulation.diagnostics.digest(), len(simulation.diagnostics.events)

    assert fly(200) == fly(200) == fly(8)
    assert fly(200)[1] == 2


def set_request(simulation, name="", **sizes):
    return request_of(simulation.graph, "/volery/set_grid_map", name=name, **sizes)


def occupancy(data, width, *, x=0.0, y=0.0, resolution=1.0, turn=(0.0, 0.0, 0.0, 1.0)):
    cells = np.array(data, dtype=np.int8)
    pose = Pose(Point(x, y, 0.0), Quaternion(*turn))
    info = MapMetaData(time_from_ns(0), resolution, width, len(cells) // width, pose)
    return OccupancyGrid(Header(time_from_ns(0), "map"), info, cells)


def test_a_map_of_the_graph_becomes_blocks(simulate, blocks_data):
    simulation = simulate(blocks_data)
    ahead, shown = Ahead(simulation), []
    simulation.graph.subscribe("/map", lambda m: shown.append(m.message))
    sender = simulation.graph.advertise("/map_command", OccupancyGrid)
    simulation.run(0.1)
    assert (shown[0].info.width, shown[0].info.height) == (3, 7)
    assert shown[0].data.tolist() == [0, 0, 100] * 7
    # Row 0 lies at the lowest y: of the two rows, that around y = 0 has its block at x = 4.
    rows = [0, 100, 0, 0, 0, 49, 0, 0, 0, 50]
    sender.publish(occupancy(rows, 5, y=-1.5))
    simulation.step(1)
    simulation.run(0.03)
    assert ahead.ranges[-1] == pytest.approx(4.0, abs=1e-3)
    assert shown[-1].data.tolist() == [0, 100, *[0] * 7, 100]
    assert (simulation.world.grid_map.current.name, simulation.world.grid_map.current.rows) == (
        "map_command",
        2,
    )
    half = np.sqrt(0.5)  # a quarter turn: the rows run towards -x, the columns towards y
    sender.publish(occupancy([0, 0, 0, 100], 2, x=9.0, y=-1.5, turn=(0, 0, half, half)))
    simulation.run(0.03)
    assert ahead.ranges[-1] == pytest.approx(7.0, abs=1e-3)


def test_a_matrix_stands_as_it_is_read_and_is_published_as_the_message_wants(
    simulate, tmp_path, flat_data
):
    """The first line is the top, at the highest y; a message begins with the lowest."""
    (tmp_path / "l.csv").write_text("1,0\n1,0\n1,1\n")  # an L
    world = {"grid_map": {"maps": [{"file": str(tmp_path / "l.csv")}], "origin_m": [5.0, 5.0]}}
    simulation = simulate({**flat_data, "world": world})
    shown = []
    simulation.graph.subscribe("/map", lambda m: shown.append(m.message))
    simulation.step(1)
    assert shown[0].data.tolist() == [100, 100, 100, 0, 100, 0]
    x, y = np.meshgrid([5.5, 6.5], [7.5, 6.5, 5.5])
    above = np.column_stack([x.ravel(), y.ravel(), np.full(6, 20.0)])
    down = simulation.world.scene.cast(above, np.tile([0.0, 0.0, -1.0], (6, 1)), 50.0)
    heights = (20.0 - down.distance).reshape(3, 2)
    np.testing.assert_allclose(heights, [[5, 0], [5, 0], [5, 5]], atol=1e-5)
    again = grid_of(shown[0], 5.0)
    np.testing.assert_array_equal(again.blocked, simulation.world.grid_map.current.blocked)


@pytest.mark.parametrize(("blocked", "want"), [(False, np.inf), (True, 3.0)])
def test_unknown_cells_are_free_or_blocked(simulate, blocks_data, blocked, want):
    blocks_data["world"]["grid_map"] = {"unknown_is_blocked": blocked}
    simulation = simulate(blocks_data)
    ahead = Ahead(simulation)
    sender = simulation.graph.advertise("/map_command", OccupancyGrid)
    simulation.run(0.05)
    assert np.isinf(ahead.ranges[-1])
    assert simulation.world.grid_map.current is None
    sender.publish(occupancy([0, -1], 2, y=-1.5, resolution=3.0))
    simulation.run(0.05)
    assert ahead.ranges[-1] == pytest.approx(want, abs=1e-3)


def test_maps_that_are_none_are_refused_in_an_event(simulate, blocks_data):
    simulation = simulate(blocks_data)
    before = simulation.world.grid_map.current
    sender = simulation.graph.advertise("/map_command", OccupancyGrid)
    wrong = [
        occupancy([0, 0, 0], 3),
        occupancy([0], 1, resolution=0.0),
        occupancy([0], 1, resolution=float("nan")),
        occupancy([0], 1, turn=(0.5, 0.5, 0.5, 0.5)),
        occupancy([], 1),
        occupancy([100], 1, x=1e4),
    ]
    wrong[0].info.height = 2
    wrong[4].info.height = 0
    for message in wrong:
        sender.publish(message)
    simulation.step(1)
    details = [event.detail for event in simulation.diagnostics.events]
    assert len(details) == len(wrong)
    assert all(text.startswith("a grid map was refused: ") for text in details)
    words = ("as many entries", "cell_size_m", "finite", "about z", "0 x 1 cells", "beyond the")
    assert all(word in text for word, text in zip(words, details, strict=True)), details
    assert simulation.world.grid_map.current is before


def test_services_change_and_return_the_map(simulate, blocks_data):
    simulation = simulate(blocks_data)
    response = call_service(simulation, "/volery/get_grid_map")
    assert (response.name, response.names, response.rows, response.columns) == (
        "near",
        ["near", "far"],
        7,
        3,
    )
    assert call_service(simulation, "/volery/set_grid_map", name="far", block_height=2.0).success
    response = call_service(simulation, "/volery/get_grid_map")
    assert (response.name, response.block_height, response.cell_size) == ("far", 2.0, 3.0)
    for wrong, word in (
        ({"name": "none"}, "known: near, far"),
        ({"block_height": -1.0}, "block_height_m"),
        ({"cell_size": float("nan")}, "cell_size_m"),
        ({"cell_size": 900.0}, "beyond the terrain"),
    ):
        refused = call_service(simulation, "/volery/set_grid_map", **wrong)
        assert not refused.success
        assert word in refused.message
    assert call_service(simulation, "/volery/get_grid_map").name == "far"


def test_resets_and_snapshots_take_the_map_along(simulate, blocks_data):
    simulation = simulate(blocks_data)
    simulation.diagnostics.enable_digest()
    ahead = Ahead(simulation)
    simulation.run(0.1)
    simulation.world.grid_map.change("far")
    simulation.run(0.1)
    kept = simulation.snapshot()
    simulation.run(0.2)
    want, seen = simulation.diagnostics.digest(), ahead.ranges[-8:]
    simulation.world.grid_map.change("near", block_height_m=LOW_M)
    simulation.run(0.1)
    simulation.restore(kept)
    simulation.run(0.2)
    assert simulation.diagnostics.digest() == want
    assert ahead.ranges[-8:] == seen
    assert seen[-1] == pytest.approx(12.0, abs=1e-3)
    shown = []
    simulation.graph.subscribe("/map", lambda m: shown.append(m.message.info.width))
    simulation.reset()
    simulation.run(0.1)
    assert ahead.ranges[-1] == pytest.approx(FIRST_WALL_M, abs=1e-3)
    assert shown[-1] == 3
    assert simulation.world.grid_map.current.block_height_m == TALL_M


def test_a_uav_inside_a_new_block_touches_it_with_the_next_step(simulate, blocks_data):
    simulation = simulate(blocks_data)
    simulation.run(0.1)
    assert not simulation.diagnostics.events
    simulation.world.grid_map.change("far", cell_size_m=60.0)
    simulation.world.grid_map.change("near", cell_size_m=3.0)
    simulation.run(0.1)
    assert {event.kind for event in simulation.diagnostics.events} == {EventKind.WORLD}
    sender = simulation.graph.advertise("/map_command", OccupancyGrid)
    sender.publish(occupancy([100], 1, x=-20.0, y=-20.0, resolution=40.0))
    simulation.step(1)  # it is taken at the end of this one
    at_ns = simulation.time_ns
    simulation.step(5)
    touch = next(e for e in simulation.diagnostics.events if e.kind is EventKind.COLLISION)
    assert (touch.uav, touch.partner, touch.time_ns) == ("uav1", "block", at_ns + 1_000_000)


def test_uavs_are_not_placed_in_blocks(simulate, blocks_data):
    blocks_data["uavs"][0]["position_m"] = [7.5, 0.0, 3.0]  # in the middle, far from all walls
    blocks_data["world"]["grid_map"]["cell_size_m"] = 20.0
    blocks_data["uavs"][0]["position_m"] = [50.0, 0.0, 3.0]
    with pytest.raises(PlacementError, match="lies inside block"):
        simulate(blocks_data)
    blocks_data["world"]["grid_map"]["cell_size_m"] = 3.0
    blocks_data["uavs"] = [
        {"type": "f450", "position_m": [7.5, 0.0], "placement": "nearest_free"},
    ]
    start = simulate(blocks_data).vehicles.start_poses[0].position_map
    assert np.linalg.norm(start[:2] - [7.5, 0.0]) < 4.0
    assert not 5.0 < start[0] < 10.0


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"map": "x"}, ScenarioError, "map 'x' is not among the maps; known: near, far"),
        ({"cell_size_m": 0.0}, ScenarioError, "cell_size_m"),
        ({"block_height_m": 2000.0}, ScenarioError, "block_height_m"),
        ({"origin_m": [495.0, 0.0]}, ScenarioError, "beyond the terrain"),
        ({"maps": [{"file": "map_command.csv"}]}, ScenarioError, "received over the graph"),
        ({"maps": [{"file": "none.csv"}]}, DataFileError, "no file 'none.csv'"),
        ({"maps": [{"file": "a.csv"}, {"file": "b/a.csv"}]}, ScenarioError, "used twice: a"),
    ],
)
def test_scenarios_that_cannot_be_are_refused(simulate, blocks_data, change, error, words):
    data = copy.deepcopy(blocks_data)
    data["world"]["grid_map"].update(change)
    with pytest.raises(error) as caught:
        simulate(data)
    assert words in str(caught.value)


def test_without_the_table_there_is_no_map(simulate, flat_data):
    simulation = simulate(flat_data)
    assert "/map" not in [topic.name for topic in simulation.graph.topics()]
    with pytest.raises(CommandError, match="no grid map yet"):
        simulation.world.grid_map.change(block_height_m=3.0)
