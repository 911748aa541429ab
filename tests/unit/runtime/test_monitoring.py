"""Monitoring topics: true poses, vehicles, the state of the run."""

import math
import time

import pytest
from fake_wall_clock import FakeWallClock
from recorded_messages import ExternalSubscriber
from service_calls import call_service
from test_pause import InThread, wait_for

from volery.engine import pacing
from volery.graph.messages import Twist, Vector3
from volery.runtime.monitoring import monitor
from volery.runtime.monitoring.status import Speedometer

TF = "/ground_truth/tf"
VEHICLES = "/volery/vehicles"
STATUS = "/volery/status"
ACTOR = {
    "name": "walker",
    "shape": "person",
    "motion": {"kind": "external", "position_m": [30.0, 0.0, 0.0]},
}


def poses(message):
    return {
        t.child_frame_id: (
            [t.transform.translation.x, t.transform.translation.y, t.transform.translation.z],
            [getattr(t.transform.rotation, axis) for axis in "xyzw"],
        )
        for t in message.transforms
    }


def stamp_s(message):
    stamp = message.transforms[0].header.stamp
    return stamp.sec + 1e-9 * stamp.nanosec


@pytest.fixture
def wall(monkeypatch):
    """The wall time by which changes are shown."""
    clock = FakeWallClock()
    monkeypatch.setattr(monitor, "time", clock.time)
    return clock


@pytest.fixture
def three(flat_data):
    flat_data["uavs"] = [
        {"type": "f450", "count": 3, "position_m": [0.0, 0.0], "last_position_m": [20.0, 0.0]}
    ]
    flat_data["uavs"][0]["on_start"] = "take_off"
    return flat_data


# ------------------------------------------------------------------------------------------ poses


def test_true_poses_of_all_in_one_message(simulate, three):
    simulation = simulate(three)
    subscriber = ExternalSubscriber(simulation, TF)
    simulation.run(0.5)
    messages = subscriber.take(TF)
    assert [round(stamp_s(m), 6) for m in messages] == [
        pytest.approx(0.02 * k) for k in range(1, 26)
    ]
    last = messages[-1]
    assert [t.child_frame_id for t in last.transforms] == [f"uav{k}/base_link" for k in (1, 2, 3)]
    assert {t.header.frame_id for t in last.transforms} == {"map"}
    for name, uav in simulation.uavs.items():
        position, turn = poses(last)[f"{name}/base_link"]
        assert position == uav.position_map.tolist()
        assert turn == uav.attitude.tolist()


def test_actors_come_after_the_uavs(simulate, flat_data, wall):
    flat_data["world"] = {"actors": [ACTOR]}
    simulation = simulate(flat_data)
    subscriber = ExternalSubscriber(simulation, TF)
    simulation.run(0.02)
    assert list(poses(subscriber.last(TF))) == ["uav1/base_link", "walker"]
    simulation.world.set_actor_pose("walker", [31.0, 2.0, 0.0])
    simulation.process_commands()
    wall.wait(0.06)
    simulation.process_commands()
    assert poses(subscriber.last(TF))["walker"][0] == [31.0, 2.0, 0.0]


def test_uavs_that_come_and_go_are_published(simulate, flat_data):
    simulation = simulate(flat_data)
    subscriber = ExternalSubscriber(simulation, TF, VEHICLES)
    simulation.run(0.02)
    simulation.vehicles.spawn("scout", "crazyflie", [5.0, 5.0, 0.0])
    simulation.run(0.2)
    assert list(poses(subscriber.last(TF))) == ["uav1/base_link", "scout/base_link"]
    scout = subscriber.last(VEHICLES).vehicles[1]
    assert (scout.name, scout.airframe, scout.type) == ("scout", "crazyflie", "crazyflie")
    simulation.vehicles.delete("uav1")
    simulation.run(0.2)
    assert list(poses(subscriber.last(TF))) == ["scout/base_link"]
    assert [v.name for v in subscriber.last(VEHICLES).vehicles] == ["scout"]


def test_nothing_is_built_without_subscribers(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.run(0.3)
    counts = {t.name: t.messages for t in simulation.graph.topics()}
    assert (counts[TF], counts[VEHICLES], counts[STATUS]) == (0, 0, 0)


# --------------------------------------------------------------------------------------- vehicles


def test_vehicles_are_published_as_they_are(simulate, three):
    simulation = simulate(three)
    subscriber = ExternalSubscriber(simulation, VEHICLES)
    simulation.run(0.2)
    first = subscriber.last(VEHICLES)
    assert first.header.frame_id == "map"
    assert [v.mode for v in first.vehicles] == ["TAKE_OFF"] * 3
    simulation.run(1.8)
    message = subscriber.last(VEHICLES)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (2, 0)
    for vehicle, (name, uav) in zip(message.vehicles, simulation.uavs.items(), strict=True):
        assert (vehicle.name, vehicle.airframe, vehicle.type) == (name, "f450", "f450")
        assert vehicle.mode == uav.mode.name
        assert vehicle.airborne
        assert not vehicle.crashed
        assert vehicle.battery == pytest.approx(uav.battery_charge, abs=1e-6)
        assert vehicle.voltage == pytest.approx(uav.battery_voltage, abs=1e-4)
        p, v = vehicle.position, vehicle.velocity
        assert [p.x, p.y, p.z] == uav.position_map.tolist()
        assert [v.x, v.y, v.z] == uav.velocity_map.tolist()
        full = uav.airframe.rotors.max_speed_rad_s
        assert vehicle.rotor_speed == pytest.approx(uav.rotor_speed.mean() / full, rel=1e-6)
        assert (vehicle.command_age, vehicle.operator) == (-1.0, "")


def test_the_ground_the_air_and_a_wreck(simulate, flat_data):
    simulation = simulate(flat_data)
    subscriber = ExternalSubscriber(simulation, VEHICLES)
    simulation.run(0.2)
    standing = subscriber.last(VEHICLES).vehicles[0]
    assert (standing.mode, standing.airborne, standing.rotor_speed) == ("LANDED", False, 0.0)
    simulation.vehicles.set_pose("uav1", [0.0, 0.0, 8.0], [0.0, 0.0, 0.0, 1.0])
    simulation.run(0.2)
    assert subscriber.last(VEHICLES).vehicles[0].airborne
    simulation.uavs["uav1"].stop_rotors()
    simulation.run(0.6)
    falling = subscriber.last(VEHICLES).vehicles[0]
    assert (falling.mode, falling.airborne, falling.crashed) == ("LOW_LEVEL", True, False)
    simulation.run(4.0)
    wreck = subscriber.last(VEHICLES).vehicles[0]
    assert (wreck.mode, wreck.airborne, wreck.crashed) == ("CRASHED", False, True)


def test_an_airframe_without_a_battery(simulate, flat_data, tmp_path):
    from volery.vehicle import airframe

    folder = airframe.__file__.replace("airframe.py", "airframes")
    with open(f"{folder}/f450.toml", encoding="utf-8") as file:
        text = file.read()
    path = tmp_path / "bare.toml"
    bare = text[: text.index("[battery]")].replace('name = "f450"', 'name = "bare"')
    path.write_text(bare, encoding="utf-8")
    flat_data["types"]["f450"]["airframe"] = str(path)
    simulation = simulate(flat_data)
    subscriber = ExternalSubscriber(simulation, VEHICLES)
    simulation.run(0.2)
    state = subscriber.last(VEHICLES).vehicles[0]
    assert state.airframe == "bare"
    assert math.isnan(state.battery)
    assert math.isnan(state.voltage)


def test_the_time_without_external_commands(simulate, three, wall):
    simulation = simulate(three)
    subscriber = ExternalSubscriber(simulation, VEHICLES)
    inside = simulation.graph.advertise("/uav3/cmd_vel", Twist)
    inside.publish(Twist(Vector3(0.1, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)))
    simulation.run(0.1)
    subscriber.session.advertise("/uav1/cmd_vel", "geometry_msgs/msg/Twist")
    subscriber.session.publish("/uav1/cmd_vel", Twist(Vector3(0.1, 0, 0), Vector3(0, 0, 0)))
    simulation.run(0.1)
    ages = [v.command_age for v in subscriber.last(VEHICLES).vehicles]
    assert ages == [pytest.approx(0.1), -1.0, -1.0]
    kept = simulation.snapshot()
    simulation.run(0.2)
    responses = []
    from volery.graph.service_reply import ServiceReply

    subscriber.session.call("/uav2/hold", None, ServiceReply(responses.append, responses.append))
    simulation.run(0.2)
    assert len(responses) == 1
    ages = [v.command_age for v in subscriber.last(VEHICLES).vehicles]
    assert ages == [pytest.approx(0.5), pytest.approx(0.2), -1.0]
    simulation.restore(kept)
    wall.wait(0.25)
    simulation.process_commands()
    ages = [v.command_age for v in subscriber.last(VEHICLES).vehicles]
    assert ages == [pytest.approx(0.1), -1.0, -1.0]


# ----------------------------------------------------------------------------------- while paused


@pytest.fixture
def paused(simulate, three):
    """Three UAVs that stand still in time, in a run of its own thread."""
    simulation = simulate(three)
    simulation.run(3.0)
    simulation.clock.pause()
    with InThread(simulation, 60.0, speed=1.0):
        yield simulation
        simulation.clock.quit()


def test_a_client_that_connects_while_paused_gets_messages_at_once(paused):
    subscriber = ExternalSubscriber(paused, TF, VEHICLES, STATUS)
    got = {TF: [], VEHICLES: []}

    def come():
        for topic, messages in got.items():
            messages.extend(subscriber.take(topic))
        return all(got.values())

    wait_for(come)
    assert stamp_s(got[TF][0]) == 3.0
    wait_for_statuses(subscriber, 3)
    assert subscriber.take(TF) == subscriber.take(VEHICLES) == []  # nothing has changed


def wait_for_statuses(subscriber, count):
    """Until the run has looked so often for what it shows in between, 0.2 s apart."""
    statuses = []
    wait_for(lambda: statuses.extend(subscriber.take(STATUS)) or len(statuses) >= count)


def test_what_changes_while_paused_is_shown(paused):
    subscriber = ExternalSubscriber(paused, TF, VEHICLES)
    wait_for(lambda: subscriber.take(TF))
    wait_for(lambda: subscriber.take(VEHICLES))
    seen = []

    def shows(topic, check):
        def look():
            seen[:] = subscriber.take(topic) or seen
            return bool(seen) and check(seen[-1])

        seen.clear()
        wait_for(look)

    moved = [4.0, 7.0, 5.0]
    paused.post(lambda: paused.vehicles.set_pose("uav2", moved, [0.0, 0.0, 0.0, 1.0])).result()
    shows(TF, lambda m: poses(m)["uav2/base_link"][0] == moved)
    shows(VEHICLES, lambda m: m.vehicles[1].position.z == 5.0)
    paused.post(paused.uavs["uav1"].land).result()
    shows(VEHICLES, lambda m: m.vehicles[0].mode == "LAND")
    paused.clock.single_step(5)
    shows(TF, lambda m: stamp_s(m) == pytest.approx(3.005))
    paused.post(lambda: paused.vehicles.spawn("extra", "crazyflie", [9.0, 9.0, 0.0])).result()
    shows(TF, lambda m: "extra/base_link" in poses(m))
    shows(VEHICLES, lambda m: m.vehicles[-1].name == "extra")


def test_slow_motion_is_shown_in_between(simulate, three, wall, monkeypatch):
    simulation = simulate(three)
    monkeypatch.setattr(pacing, "time", wall.time)
    monkeypatch.setattr(simulation._pacer._changed, "wait", wall.wait)
    simulation.run(1.0)
    subscriber = ExternalSubscriber(simulation, TF)
    simulation.run(0.06, speed=0.06)
    stamps = [stamp_s(m) for m in subscriber.take(TF)]
    assert len(stamps) > 8  # three are on the grid
    assert stamps == sorted(stamps)


# ----------------------------------------------------------------------------------------- status


def still(status):
    """Whether nothing has been computed in the last seconds."""
    return status.real_time_factor == 0.0 and not status.load.any()


def test_the_status_comes_in_wall_time_also_while_paused(paused):
    begun_s, statuses = time.time(), []
    subscriber = ExternalSubscriber(paused, STATUS)
    wait_for(
        lambda: (
            statuses.extend(subscriber.take(STATUS)) or (len(statuses) >= 3 and still(statuses[-1]))
        )
    )
    ended_s = time.time()
    assert len(statuses) <= 5.0 * (ended_s - begun_s) + 2
    last = statuses[-1]
    assert (last.scenario, last.state, last.speed, last.duration) == ("flat", 2, 1.0, 60.0)
    assert (last.stamp.sec, last.stamp.nanosec) == (3, 0)
    assert begun_s <= last.wall.sec + 1e-9 * last.wall.nanosec <= ended_s
    assert last.clients == 1
    assert 50.0 < last.memory < 10_000.0
    assert not last.replaying
    stamps = [m.wall.sec + 1e-9 * m.wall.nanosec for m in statuses]
    assert stamps == sorted(stamps)
    paused.clock.resume()
    statuses.clear()
    wait_for(
        lambda: (
            statuses.extend(subscriber.take(STATUS))
            or (statuses and statuses[-1].real_time_factor > 0)
        )
    )
    last = statuses[-1]
    assert last.state == 1
    stages = dict(zip(last.stages, last.load, strict=True))
    assert list(stages) == list(paused.diagnostics.stage_seconds)
    assert stages["advance_vehicles"] > 0.0
    assert sum(stages.values()) * last.real_time_factor < 1.0  # parts of the wall time
    paused.clock.set_speed(None)
    wait_for(lambda: any(m.speed == 0.0 for m in subscriber.take(STATUS)))


def test_the_status_knows_of_recordings_and_losses(simulate, flat_data, tmp_path):
    simulation = simulate(flat_data, recordings=tmp_path)
    subscriber = ExternalSubscriber(simulation, STATUS)
    late = ExternalSubscriber(simulation, TF, depth=2)
    assert call_service(simulation, "/volery/start_recording", path="day/a.mcap").success
    simulation.run(0.2)  # ten true poses, of which the slow client loses eight
    simulation._monitor._status.jumped()
    simulation.process_commands()
    status = subscriber.last(STATUS)
    assert (status.recording, status.dropped, status.clients) == ("day/a.mcap", 8, 2)
    late.session.close()
    assert call_service(simulation, "/volery/stop_recording").success
    simulation._monitor._status.jumped()
    simulation.process_commands()
    status = subscriber.last(STATUS)
    assert (status.recording, status.dropped, status.clients) == ("", 8, 1)


def test_the_speedometer_looks_back_over_a_second():
    meter = Speedometer()
    stages = {"a": 0.0, "b": 0.0}
    for k in range(21):  # two seconds at half of real time, then two at twice
        measured = meter.read(0.1 * k, round(0.05e9 * k), {"a": 0.01 * k, "b": 0.0})
    assert measured.real_time_factor == pytest.approx(0.5)
    assert measured.load == [pytest.approx(0.2), 0.0]
    for k in range(1, 21):
        measured = meter.read(2.0 + 0.1 * k, round(1e9 + 0.2e9 * k), {"a": 0.2, "b": 0.1 * k})
    assert measured.real_time_factor == pytest.approx(2.0)
    assert measured.load == [0.0, pytest.approx(0.5)]
    assert meter.read(4.1, 0, stages) == (0.0, [0.0, 0.0])  # gone back
    assert meter.read(4.2, 0, stages) == (0.0, [0.0, 0.0])  # paused


# ------------------------------------------------------------------------------------- determinism


def test_subscribers_change_nothing(simulate, wood_data):
    def digest(watched):
        simulation = simulate(wood_data)
        simulation.diagnostics.enable_digest()
        if not watched:
            simulation.run(1.0)
            return simulation.diagnostics.digest()
        subscriber = ExternalSubscriber(
            simulation, TF, VEHICLES, STATUS, "/uav1/laser/nodding/points"
        )
        with InThread(simulation, 1.0, speed=2.0):
            wait_for(lambda: simulation.time_s > 0.2)
            simulation.clock.pause()
            wait_for(lambda: subscriber.take(STATUS))
            simulation.clock.single_step(7)
            late = ExternalSubscriber(simulation, TF, VEHICLES)
            wait_for(lambda: late.take(VEHICLES))
            simulation.clock.set_speed(0.5)
            simulation.clock.resume()
        assert subscriber.take("/uav1/laser/nodding/points")
        return simulation.diagnostics.digest()

    assert digest(watched=True) == digest(watched=False)


def test_no_node_receives_what_follows_wall_time(paused):
    topics = []
    subscriber = ExternalSubscriber(paused, STATUS, TF)
    paused.post(lambda: paused.graph.subscribe_all(lambda m: topics.append(m.topic))).result()
    paused.post(
        lambda: paused.vehicles.set_pose("uav1", [3.0, 3.0, 4.0], [0.0, 0.0, 0.0, 1.0])
    ).result()
    wait_for_statuses(subscriber, 3)
    assert poses(subscriber.last(TF))["uav1/base_link"][0] == [3.0, 3.0, 4.0]
    assert STATUS not in topics
    assert TF not in topics


# ---------------------------------------------------------------------------------- after a jump


@pytest.mark.parametrize("how", ["restore", "reset"])
def test_after_a_jump_all_clients_get_messages_again(simulate, flat_data, wall, tmp_path, how):
    blocks = tmp_path / "blocks.csv"
    blocks.write_text("1,0\n0,1\n", encoding="utf-8")
    flat_data["world"] = {"grid_map": {"maps": [{"file": str(blocks)}], "origin_m": [30.0, 30.0]}}
    simulation = simulate(flat_data)
    simulation.run(0.1)
    kept = simulation.snapshot()
    subscriber = ExternalSubscriber(simulation, "/weather", "/map", TF, VEHICLES)
    call_service(simulation, "/volery/set_weather", only=["rain"], rain=9.0)
    call_service(simulation, "/volery/set_grid_map", cell_size=3.0)
    simulation.run(0.5)
    assert subscriber.last("/weather").rain == 9.0
    assert subscriber.last("/map").info.resolution == 3.0
    subscriber.take(TF)
    subscriber.take(VEHICLES)
    simulation.restore(kept) if how == "restore" else simulation.reset()
    wall.wait(0.25)
    simulation.post(lambda: None)
    simulation.process_commands()
    assert subscriber.last("/weather").rain == 0.0
    assert subscriber.last("/map").info.resolution == 1.0
    assert stamp_s(subscriber.last(TF)) == (0.1 if how == "restore" else 0.0)
    assert subscriber.last(VEHICLES).header.stamp.sec == 0
