"""Three UAVs fly over every free cell of a small map, whatever happens to one of them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from volery.graph.messages import OccupancyGrid
from volery.runtime.services.grid_maps import occupancy_of
from volery.world.grid_maps import GridMap

FIELD = ["00000000", "00011000", "00011100", "00000000", "00000000"]
CELL_M = 4.0


class Watch:
    """What the planner publishes, and where the UAVs really were."""

    def __init__(self, simulation):
        self.simulation = simulation
        self.status, self.covered, self.areas = {}, None, None
        self.paths = {}
        self.tracks = {name: [] for name in simulation.uavs}
        graph = simulation.graph
        graph.subscribe("/coverage/status", self._on_status)
        graph.subscribe("/coverage/covered", lambda p: setattr(self, "covered", grid(p.message)))
        graph.subscribe("/coverage/areas", lambda p: setattr(self, "areas", grid(p.message)))
        for name in simulation.uavs:
            graph.subscribe(f"/{name}/coverage/path", self._on_path)

    def _on_status(self, published):
        self.status = json.loads(published.message.data)

    def _on_path(self, published):
        self.paths[published.topic.split("/")[1]] = published.message.poses

    def fly(self, until_s):
        while self.simulation.time_s < until_s and not self.simulation.clock.finished:
            self.simulation.run(0.2)
            for name, uav in self.simulation.uavs.items():
                self.tracks[name].append(uav.position_map)

    def flown_cells(self, shape):
        """Sub-cells that some UAV was in, in the air."""
        positions = np.vstack([np.array(track) for track in self.tracks.values()])
        positions = positions[positions[:, 2] > 1.5]
        columns, rows = np.floor(positions[:, :2] / (CELL_M / 2.0)).astype(int).T
        seen = np.zeros((2 * shape[0], 2 * shape[1]), bool)
        seen[rows, columns] = True
        return seen


def grid(message):
    return np.asarray(message.data).reshape(message.info.height, message.info.width)


def field_data(tmp_path, rows=FIELD, **parameters):
    (tmp_path / "field.csv").write_text("\n".join(",".join(row) for row in rows) + "\n")
    planner = {
        "node": "coverage",
        "parameters": {"uavs": ["uav1", "uav2", "uav3"], **parameters},
    }
    maps = [{"file": str(tmp_path / "field.csv")}]
    return {
        "name": "field",
        "ends_when": "all_landed",
        "duration_s": 400.0,
        "world": {"grid_map": {"maps": maps, "cell_size_m": CELL_M}},
        "types": {"f450": {"sensors": [{"kind": "odometry", "noise": False}]}},
        "uavs": [{"type": "f450", "count": 3, "position_m": [2, 2], "last_position_m": [26, 2]}],
        "nodes": [planner],
    }


def test_three_uavs_cover_every_free_cell_and_land(tmp_path, simulate):
    watch = Watch(simulate(field_data(tmp_path)))
    watch.fly(400.0)
    free = np.array([[c == "0" for c in row] for row in FIELD[::-1]])
    assert watch.simulation.clock.finished
    assert all(uav.mode.name == "LANDED" for uav in watch.simulation.uavs.values())
    np.testing.assert_array_equal(watch.covered == 100, free)
    assert watch.flown_cells(free.shape)[np.kron(free, np.ones((2, 2), bool))].all()
    assert sorted(watch.status["cells"]) == [11, 12, 12]
    assert watch.status["covered"] == 1.0
    np.testing.assert_array_equal(np.bincount(watch.areas[free])[1:], watch.status["cells"])
    together = np.stack([np.array(track) for track in watch.tracks.values()])
    for a, b in ((0, 1), (0, 2), (1, 2)):
        assert np.linalg.norm(together[a] - together[b], axis=1).min() > 1.0
    assert all(len(watch.paths[name]) > 4 for name in watch.simulation.uavs)


def test_the_others_share_what_a_lost_uav_leaves(tmp_path, simulate):
    watch = Watch(simulate(field_data(tmp_path, timeout_s=4.0)))
    watch.fly(20.0)
    for rotor in range(4):
        watch.simulation.faults.inject({"kind": "motor", "uav": "uav2", "rotor": rotor})
    watch.fly(400.0)
    free = np.array([[c == "0" for c in row] for row in FIELD[::-1]])
    assert watch.status["phases"] == {"uav1": "done", "uav2": "failed", "uav3": "done"}
    np.testing.assert_array_equal(watch.covered == 100, free)
    assert not (watch.areas == 2).any()


def test_a_start_outside_the_map_is_reported_and_no_uav_flies(tmp_path, simulate):
    watch = Watch(simulate(field_data(tmp_path, ["000000", "000000"])))
    watch.fly(5.0)
    assert watch.status["state"] == "refused"
    assert watch.status["reason"].startswith("UAV 3 starts in row 0, column 6, which lies outside")
    assert all(uav.mode.name == "LANDED" for uav in watch.simulation.uavs.values())


def test_cells_beyond_blocks_are_flown_to_or_reported(tmp_path, simulate):
    rows = ["00010", "00010", "00010"]
    for crossing_height_m, missing in ((0.0, 3), (7.0, 0)):
        data = field_data(tmp_path, rows, crossing_height_m=crossing_height_m, uavs=["uav1"])
        data["uavs"] = [{"type": "f450", "position_m": [2, 2]}]
        watch = Watch(simulate(data))
        watch.fly(400.0)
        assert watch.status["unreachable"] == missing
        assert np.count_nonzero(watch.covered == 100) == 12 - missing
        assert watch.simulation.clock.finished


def test_a_map_that_changes_is_replanned(tmp_path, simulate):
    simulation = simulate(field_data(tmp_path))
    watch = Watch(simulation)
    watch.fly(15.0)
    more = np.array([[c == "1" for c in row] for row in FIELD[::-1]])
    more[4, 7] = True
    changed = GridMap("changed", more, CELL_M, 5.0, (0.0, 0.0), 0.0)
    publisher = simulation.graph.advertise("/map_command", OccupancyGrid)
    publisher.publish(occupancy_of(changed, simulation.time_ns))
    watch.fly(400.0)
    np.testing.assert_array_equal(watch.covered == 100, ~more)
    assert watch.areas[4, 7] == -1


@pytest.mark.parametrize("latency_s", [0.0, 0.2])
def test_a_flight_goes_on_exactly_from_a_snapshot(tmp_path, simulate, latency_s):
    data = field_data(tmp_path)
    data["nodes"][0]["latency_s"] = latency_s
    simulation = simulate(data)
    simulation.run(12.0)
    kept = simulation.snapshot()
    simulation.run(6.0)
    positions = [uav.position_map for uav in simulation.uavs.values()]
    simulation.restore(kept)
    simulation.run(6.0)
    np.testing.assert_array_equal(positions, [uav.position_map for uav in simulation.uavs.values()])
    simulation.reset()
    simulation.run(18.0)
    np.testing.assert_array_equal(positions, [uav.position_map for uav in simulation.uavs.values()])
