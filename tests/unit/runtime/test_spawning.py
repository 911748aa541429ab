"""UAVs that come and go while the simulation runs, and those that do not notice."""

import numpy as np
import pytest

from volery.control.flight_modes import FlightMode
from volery.control.trajectory import Trajectory
from volery.core.errors import CommandError, PlacementError, SnapshotError, SpawnError, SpawnFault
from volery.core.rng import stream_key

EVERY_SENSOR = [
    {"kind": "lidar", "nodding": {}},
    {"kind": "imu"},
    {"kind": "sonar"},
    {"kind": "gnss"},
    {"kind": "barometer"},
    {"kind": "magnetometer"},
    {"kind": "estimate"},
    {"kind": "ground_truth"},
    {"kind": "battery"},
]


@pytest.fixture
def mixed(flat_data):
    """Four UAVs of all plants in wind: one on its estimate, one with a dead time."""
    flat_data["world"] = {"wind": {"velocity_m_s": [3.0, 0.0, 0.0], "turbulence": "light"}}
    flat_data["types"] = {
        "full": {"sensors": EVERY_SENSOR},
        "drifting": {"sensors": [{"kind": "imu"}, {"kind": "odometry"}]},
        "model": {"plant": "identified"},
        "puppet": {"plant": "kinematic", "sensors": [{"kind": "imu"}]},
    }
    flat_data["uavs"] = [
        {"type": kind, "position_m": [20.0 * i, 0.0, 5.0]}
        for i, kind in enumerate(("full", "drifting", "model", "puppet"))
    ]
    return flat_data


class Witness:
    """All messages of some UAVs, and their states, as bytes."""

    def __init__(self, simulation, names):
        self.simulation, self.names = simulation, names
        self.messages = []
        below = tuple(f"/{name}/" for name in names)
        simulation.graph.subscribe_all(
            lambda p: (
                self.messages.append((p.time_ns, p.topic, repr(p.message)))
                if p.topic.startswith(below)
                else None
            )
        )

    def states(self):
        uavs = [self.simulation.uavs[name] for name in self.names]
        return [(u.position_map.tobytes(), u.attitude.tobytes(), u.mode) for u in uavs]


def fly(simulation, seconds):
    """Keep all busy: velocities, a trajectory's worth of goals, take-offs."""
    for i, name in enumerate(("uav1", "uav2", "uav3", "uav4")):
        if name in simulation.uavs and simulation.uavs[name].mode is not FlightMode.TRAJECTORY:
            simulation.uavs[name].command_velocity([0.5, 0.1 * i, 0.05], 0.2)
    simulation.run(seconds)


@pytest.mark.parametrize("deleted", ["extra", "uav2"])
def test_others_do_not_notice(simulate, mixed, deleted):
    """What the others measure and where they are stays the same to the last bit."""
    names = [name for name in ("uav1", "uav3", "uav4") if name != deleted]
    alone = simulate(mixed)
    seen = Witness(alone, names)
    for seconds in (0.3137, 0.4, 0.5, 0.4):
        fly(alone, seconds)
    changing = simulate(mixed)
    witness = Witness(changing, names)
    fly(changing, 0.3137)
    changing.vehicles.spawn("extra", "full", [0.0, 40.0, 3.0])
    fly(changing, 0.4)
    changing.vehicles.delete(deleted)
    fly(changing, 0.5)
    changing.vehicles.spawn("later", "model", [0.0, 60.0, 3.0])
    fly(changing, 0.4)
    assert witness.messages == seen.messages
    assert witness.states() == seen.states()
    assert changing.vehicles.names[-1] == "later"


def test_a_uav_on_a_trajectory_flies_on(simulate, flat_data):
    def end(change):
        simulation = simulate(flat_data)
        uav = simulation.uavs["uav1"]
        uav.take_off()
        simulation.run(4.0)
        path = [[0.0, 0.0, 0.0], [3.0, 0.0, 1.0], [6.0, 2.0, 0.0]]
        uav.follow_trajectory(Trajectory.from_samples([0.0, 3.0, 6.0], uav.position_map + path))
        simulation.run(1.5)
        if change:
            simulation.vehicles.spawn("other", "f450", [50.0, 0.0, 0.0])
            simulation.run(1.0)
            simulation.vehicles.delete("other")
        else:
            simulation.run(1.0)
        simulation.run(4.0)
        return uav.position_map

    np.testing.assert_array_equal(end(True), end(False))


def test_a_new_one_stands_measures_and_flies(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.run(0.5)
    received = []
    uav = simulation.vehicles.spawn("extra", "f450", [12.0, 3.0, 0.0])
    simulation.graph.subscribe("/extra/imu", received.append)
    transforms = []
    simulation.graph.subscribe("/tf_static", transforms.append)
    assert uav.mode is FlightMode.LANDED
    assert simulation.uavs["extra"] is uav
    simulation.run(0.1)
    assert len(received) == 20
    children = {t.child_frame_id for t in transforms[-1].message.transforms}
    assert {"extra/imu", "uav1/imu"} <= children
    simulation.graph.call("/extra/take_off")
    simulation.run(4.0)
    assert uav.mode is FlightMode.HOLD
    np.testing.assert_allclose(uav.position_map, [12.0, 3.0, 2.6], atol=0.2)
    assert simulation.vehicles.spawned == ("extra",)


def test_in_the_air_it_holds(simulate, flat_data):
    simulation = simulate(flat_data)
    uav = simulation.vehicles.spawn("extra", "f450", [12.0, 3.0, 6.0], [0.0, 0.0, 1.0, 0.0])
    simulation.run(2.0)
    assert uav.mode is FlightMode.HOLD
    np.testing.assert_allclose(uav.position_map, [12.0, 3.0, 6.0], atol=0.05)


def test_any_airframe_comes_with_the_usual_sensors(simulate, flat_data):
    simulation = simulate(flat_data)
    assert simulation.vehicles.spawnable[0] == "f450"
    for row, kind in enumerate(simulation.vehicles.spawnable):
        uav = simulation.vehicles.spawn(f"new{row}", kind, [10.0 + 5.0 * row, 0.0, 0.0])
        uav.take_off(2.0)
    simulation.run(6.0)
    for row, kind in enumerate(simulation.vehicles.spawnable):
        uav = simulation.uavs[f"new{row}"]
        assert uav.mode is FlightMode.HOLD, kind
        assert simulation.graph.publishers(f"/new{row}/imu") == 1
        assert simulation.graph.publishers(f"/new{row}/odom") == 1


def test_newcomers_are_seen_and_met(simulate, flat_data):
    """A LIDAR sees a UAV that was spawned before it, and a fall on it is a collision."""
    flat_data["types"]["f450"]["sensors"] = [{"kind": "lidar", "noise": False}]
    simulation = simulate(flat_data)
    scans = []
    simulation.graph.subscribe("/uav1/laser/horizontal/scan", scans.append)
    simulation.run(0.2)
    assert np.isinf(scans[-1].message.ranges).all()
    simulation.vehicles.spawn("under", "f450", [3.0, 0.0, 0.0])
    simulation.run(0.2)
    assert scans[-1].message.ranges.min() == pytest.approx(3.0, abs=0.4)
    above = simulation.vehicles.spawn("above", "f450", [3.0, 0.0, 2.0])
    above.stop_rotors()
    simulation.run(2.0)
    pairs = {(e.uav, e.partner) for e in simulation.diagnostics.events if e.kind == "collision"}
    assert ("above", "under") in pairs
    assert ("under", "above") in pairs


def test_what_is_deleted_is_gone(simulate, flat_data):
    flat_data["uavs"].append({"type": "f450", "position_m": [20.0, 0.0]})
    simulation = simulate(flat_data)
    gone = simulation.uavs["uav1"]
    simulation.run(0.1)
    simulation.vehicles.delete("uav1")
    assert simulation.vehicles.names == ("uav2",)
    assert not [t for t in simulation.graph.topics() if "uav1" in t.name and t.publishers]
    assert not [t for t in simulation.graph.topics() if "uav1" in t.name and t.subscribers]
    assert not [s for s in simulation.graph.services() if "uav1" in s]
    transforms = []
    simulation.graph.subscribe("/tf_static", transforms.append)
    simulation.run(0.1)
    names = [t.child_frame_id for t in transforms[-1].message.transforms]
    assert names
    assert not [name for name in names if name.startswith("uav1")]
    with pytest.raises(CommandError, match="uav1 was deleted"):
        gone.take_off()
    simulation.uavs["uav2"].take_off()
    simulation.run(4.0)
    assert simulation.uavs["uav2"].mode is FlightMode.HOLD
    with pytest.raises(CommandError, match="at least one"):
        simulation.vehicles.delete("uav2")
    with pytest.raises(CommandError, match="no UAV 'uav1'"):
        simulation.vehicles.delete("uav1")


def test_nodes_begin_and_end_with_their_uav(simulate, wood_data):
    simulation = simulate(wood_data)
    nodes = len(simulation.vehicles.nodes)
    simulation.run(0.2)
    other = simulation.uavs["uav1"]
    room = np.add(other.position_map, [0.0, -2.0, 0.0])
    simulation.vehicles.spawn("third", other.type_name, room)
    own = [node for node in simulation.vehicles.nodes if node.get_namespace() == "/third"]
    assert len(own) == nodes // 2
    received = []
    simulation.graph.subscribe("/third/gap_following/phase", received.append)
    simulation.run(1.0)
    assert received
    simulation.vehicles.delete("third")
    received.clear()
    simulation.run(1.0)
    assert not received
    assert len(simulation.vehicles.nodes) == nodes


def test_faults_find_their_uav_or_none(simulate, flat_data):
    flat_data["uavs"] += [
        {"type": "f450", "position_m": [20.0, 0.0]},
        {"type": "f450", "position_m": [40.0, 0.0]},
    ]
    flat_data["faults"] = [
        {"kind": "motor", "uav": "uav1", "rotor": 0, "at_s": 0.3},
        {"kind": "motor", "uav": "uav3", "rotor": 2, "at_s": 0.4},
        {"kind": "sensor", "uav": "uav3", "sensor": "imu", "effect": "dropped", "at_s": 0.4},
    ]
    simulation = simulate(flat_data)
    simulation.run(0.1)
    simulation.vehicles.delete("uav1")
    simulation.vehicles.spawn("extra", "f450", [60.0, 0.0, 0.0])
    counts = {"uav2": 0, "uav3": 0, "extra": 0}
    for name in counts:
        simulation.graph.subscribe(
            f"/{name}/imu", lambda p, name=name: counts.update({name: counts[name] + 1})
        )
    simulation.run(0.9)
    health = simulation._engine.fleet.state.rotor_health[:, :4]
    np.testing.assert_array_equal(health, [[1, 1, 1, 1], [1, 1, 0, 1], [1, 1, 1, 1]])
    assert counts["uav2"] == counts["extra"] == 180
    assert counts["uav3"] < 70
    assert {e.uav for e in simulation.diagnostics.events if e.kind == "fault"} == {"uav3"}


def test_a_reset_brings_back_the_fleet_of_the_start(simulate, wood_data):
    def digest(change):
        simulation = simulate(wood_data)
        simulation.diagnostics.enable_digest()
        if change:
            simulation.run(0.3)
            simulation.vehicles.spawn(
                "extra", next(iter(simulation.vehicles.types)), [5.0, 5.0, 30.0]
            )
            simulation.run(0.3)
            simulation.vehicles.delete("uav1")
            simulation.run(0.3)
            simulation.reset()
        assert simulation.vehicles.names == ("uav1", "uav2")
        simulation.run(1.5)
        return simulation.diagnostics.digest()

    assert digest(True) == digest(False)


def test_one_of_the_same_name_is_another(simulate, flat_data):
    """A new uav2 owes nothing to the deleted one, and a reset brings the old one back."""
    flat_data["uavs"].append({"type": "f450", "position_m": [20.0, 0.0, 5.0]})
    simulation = simulate(flat_data)
    simulation.run(0.2)
    simulation.vehicles.delete("uav2")
    new = simulation.vehicles.spawn("uav2", "f450", [30.0, 0.0, 0.0])
    assert simulation.vehicles.spawned == ("uav2",)
    assert new.mode is FlightMode.LANDED
    assert new.position_map[0] == 30.0
    simulation.reset()
    assert simulation.vehicles.spawned == ()
    assert simulation.uavs["uav2"].position_map[0] == 20.0


def test_snapshots_are_of_one_fleet(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.run(0.2)
    kept = simulation.snapshot()
    simulation.vehicles.spawn("extra", "f450", [20.0, 0.0, 0.0])
    with pytest.raises(SnapshotError, match=r"spawned or deleted.*snapshot of uav1"):
        simulation.restore(kept)
    both = simulation.snapshot()
    simulation.run(0.5)
    there = simulation.uavs["extra"].position_map
    simulation.restore(both)
    simulation.run(0.5)
    np.testing.assert_array_equal(simulation.uavs["extra"].position_map, there)
    simulation.vehicles.delete_spawned()
    simulation.restore(kept)
    assert simulation.time_s == pytest.approx(0.2)


def test_a_spawned_one_goes_back_to_where_it_began(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.run(1.0)
    uav = simulation.vehicles.spawn("extra", "f450", [20.0, 0.0, 4.0])
    uav.set_rotor_health(0, 0.9)
    uav.command_velocity([1.0, 0.0, 0.0])
    simulation.run(1.0)
    simulation.vehicles.reset("extra")
    np.testing.assert_array_equal(uav.position_map, [20.0, 0.0, 4.0])
    assert simulation._engine.fleet.state.rotor_health[1, 0] == 1.0
    simulation.run(1.0)
    np.testing.assert_allclose(uav.position_map, [20.0, 0.0, 4.0], atol=0.05)


def test_before_the_first_step_it_is_as_if_it_had_been_there(simulate, flat_data):
    def measured(data, spawn):
        simulation = simulate(data)
        if spawn:
            simulation.vehicles.spawn("uav2", "f450", [20.0, 0.0, 5.0])
        seen = Witness(simulation, ["uav1", "uav2"])
        simulation.run(0.5)
        return sorted(seen.messages), seen.states()

    there = {**flat_data, "uavs": [*flat_data["uavs"], {"type": "f450", "position_m": [20, 0, 5]}]}
    assert measured(flat_data, True) == measured(there, False)


@pytest.mark.parametrize(
    ("name", "kind", "fault"),
    [
        ("uav1", "f450", SpawnFault.NAME_TAKEN),
        ("", "f450", SpawnFault.NAME),
        ("Uav", "f450", SpawnFault.NAME),
        ("a/b", "f450", SpawnFault.NAME),
        ("volery", "f450", SpawnFault.NAME),
        ("x" * 41, "f450", SpawnFault.NAME),
        ("extra", "zeppelin", SpawnFault.TYPE),
    ],
)
def test_names_and_types_that_cannot_be(simulate, flat_data, name, kind, fault):
    simulation = simulate(flat_data)
    with pytest.raises(SpawnError) as raised:
        simulation.vehicles.spawn(name, kind, [20.0, 0.0, 0.0])
    assert raised.value.fault is fault
    assert simulation.vehicles.names == ("uav1",)


@pytest.mark.parametrize(
    ("position", "says"),
    [
        ([0.0, 0.0, 0.2], "overlaps uav1"),
        ([9e3, 0.0, 0.0], "beyond the terrain"),
        ([20.0, 0.0, -3.0], "under the ground"),
        ([np.nan, 0.0, 0.0], "finite"),
        ([0.0, 0.0], "three finite numbers"),
    ],
)
def test_invalid_spawn_positions(simulate, flat_data, position, says):
    simulation = simulate(flat_data)
    with pytest.raises(PlacementError, match=says):
        simulation.vehicles.spawn("extra", "f450", position)
    assert simulation.vehicles.names == ("uav1",)


def test_not_in_the_middle_of_a_tick(simulate, flat_data):
    simulation = simulate(flat_data)
    seen = []

    def spawn(_published):
        with pytest.raises(CommandError, match="post"):
            simulation.vehicles.spawn("extra", "f450", [20.0, 0.0, 0.0])
        seen.append(simulation.post(lambda: simulation.vehicles.spawn("extra", "f450", [20, 0, 0])))
        subscription.cancel()

    subscription = simulation.graph.subscribe("/uav1/imu", spawn)
    simulation.run(0.1)
    assert seen[0].result().name == "extra"
    assert simulation.vehicles.names == ("uav1", "extra")


def test_noise_follows_from_the_name(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.vehicles.spawn("extra", "f450", [20.0, 0.0, 0.0])
    keys = {f.id.path: f.key for f in simulation._manager.fitted}
    assert keys["extra/imu"] == stream_key(simulation.scenario.seed, "extra/imu/imu")
    assert keys["extra/imu"] != keys["uav1/imu"]
