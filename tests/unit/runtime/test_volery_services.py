"""Weather, faults, speed, recording and snapshots, as clients of the graph request them."""

import json

import pytest
from service_calls import call_service

from volery.bridges.logs.reader import summarize
from volery.core.errors import RecordingError


def refused(response, *words):
    assert not response.success
    assert all(word in response.message for word in words), response.message


def test_weather(simulate, flat_data):
    simulation = simulate(flat_data)
    assert call_service(
        simulation, "/volery/set_weather", wind={"x": 4.0, "y": -1.0}, w20=7.0
    ).success
    response = call_service(simulation, "/volery/get_weather")
    assert response.success
    assert (response.wind.x, response.wind.y, response.w20) == (4.0, -1.0, 7.0)
    assert (response.profile, response.gusts) == ("uniform", 0)
    refused(call_service(simulation, "/volery/set_weather", wind={"x": 1e6}), "out of range")
    refused(call_service(simulation, "/volery/set_weather", w20=float("nan")), "w20")
    assert simulation.world.weather.w20_m_s == 7.0


def test_gusts(simulate, flat_data):
    simulation = simulate(flat_data)
    gust = {"amplitude": {"x": 5.0}, "rise": 0.5}
    assert call_service(simulation, "/volery/gust", **gust, duration=2.0).success
    assert call_service(simulation, "/volery/gust", **gust).success
    first, second = simulation.world.weather.gusts
    assert first.end_s == 2.0
    assert second.end_s == float("inf")
    assert call_service(simulation, "/volery/get_weather").gusts == 2
    refused(call_service(simulation, "/volery/gust", **gust, duration=0.1), "end_s")
    refused(call_service(simulation, "/volery/gust", amplitude={"x": 5.0}), "rise_s")


def test_faults(simulate, flat_data):
    simulation = simulate(flat_data)
    fault = {"kind": "motor", "uav": "uav1", "rotor": 1, "thrust_factor": 0.5}
    assert call_service(simulation, "/volery/inject_fault", fault=json.dumps(fault)).success
    simulation.run(0.01)
    assert simulation.diagnostics.events[-1].kind.name == "FAULT"
    assert call_service(simulation, "/volery/end_fault", fault=json.dumps(fault)).success
    simulation.run(0.01)
    assert simulation.diagnostics.events[-1].detail == "fault over: motor"
    assert simulation._engine.fleet.state.rotor_health[0, 1] == 1.0
    gust = {"kind": "gust", "velocity_m_s": [1.0, 0.0, 0.0]}
    refused(
        call_service(simulation, "/volery/end_fault", fault=json.dumps(gust)), "cannot be ended"
    )
    refused(call_service(simulation, "/volery/inject_fault", fault="{"), "JSON")
    refused(call_service(simulation, "/volery/inject_fault", fault="[1]"), "table")
    refused(call_service(simulation, "/volery/inject_fault", fault='{"kind": "flood"}'), "kind")
    fault["uav"] = "uav9"
    for service in ("inject_fault", "end_fault"):
        refused(call_service(simulation, f"/volery/{service}", fault=json.dumps(fault)), "uav9")


def test_speed(simulate, flat_data):
    simulation = simulate(flat_data)
    assert call_service(simulation, "/volery/set_speed", factor=2.5).success
    assert simulation.clock.speed == 2.5
    for factor in (0.0, -3.0):
        assert call_service(simulation, "/volery/set_speed", factor=factor).success
        assert simulation.clock.speed is None
    refused(call_service(simulation, "/volery/set_speed", factor=float("nan")), "speed")


def test_recording(simulate, flat_data, tmp_path):
    simulation = simulate(flat_data, recordings=tmp_path)
    started = call_service(simulation, "/volery/start_recording", path="day/flight.mcap")
    assert started.success
    assert started.path == str(tmp_path / "day" / "flight.mcap")
    simulation.run(0.2)
    refused(call_service(simulation, "/volery/start_recording", path="b.mcap"), "flight.mcap")
    stopped = call_service(simulation, "/volery/stop_recording")
    assert stopped.success
    assert stopped.path == started.path
    assert stopped.messages > 20
    refused(call_service(simulation, "/volery/stop_recording"), "nothing")
    assert summarize(tmp_path / "day" / "flight.mcap").messages == stopped.messages


def test_recording_of_some_topics(simulate, flat_data, tmp_path):
    simulation = simulate(flat_data, recordings=tmp_path)
    start = "/volery/start_recording"
    refused(
        call_service(simulation, start, path="a.mcap", topics=["odom"]), "is not a topic pattern"
    )
    chosen = {"topics": ["/uav1/**", "/clock"], "exclude": ["/**/ground_truth/**"]}
    assert call_service(simulation, start, path="a.mcap", **chosen).success
    simulation.run(0.2)
    assert call_service(simulation, "/volery/stop_recording").success
    topics = {topic.topic for topic in summarize(tmp_path / "a.mcap").topics}
    assert {"/clock", "/uav1/odom"} <= topics
    assert not {name for name in topics if "ground_truth" in name or name.startswith("/volery")}


@pytest.mark.parametrize(
    ("path", "word"),
    [
        ("../outside.mcap", "outside"),
        ("/tmp/outside.mcap", "outside"),
        ("a/../../outside.mcap", "outside"),
        ("link/outside.mcap", "outside"),
        (".", "outside"),
        ("", "empty"),
        ("a\0b.mcap", "not a path"),
        ("flight.txt", ".mcap"),
        ("taken.mcap", "exists"),
    ],
)
def test_recordings_stay_in_their_folder(simulate, flat_data, tmp_path, path, word):
    folder = tmp_path / "recordings"
    folder.mkdir()
    (folder / "link").symlink_to(tmp_path)
    (folder / "taken.mcap").touch()
    simulation = simulate(flat_data, recordings=folder)
    refused(call_service(simulation, "/volery/start_recording", path=path), word)
    assert sorted(p.name for p in folder.iterdir()) == ["link", "taken.mcap"]


def test_no_folder_no_recording(simulate, flat_data):
    refused(
        call_service(simulate(flat_data), "/volery/start_recording", path="a.mcap"),
        "without a folder",
    )


def test_a_disk_that_fills_up_ends_the_recording_alone(simulate, flat_data, tmp_path, monkeypatch):
    simulation = simulate(flat_data, recordings=tmp_path)
    assert call_service(simulation, "/volery/start_recording", path="a.mcap").success

    def fail(_log, _published):
        raise RecordingError("the disk is full")

    monkeypatch.setattr("volery.bridges.logs.log_writer.McapLog.write", fail)
    simulation.run(0.1)
    assert simulation.time_s == pytest.approx(0.1)
    refused(call_service(simulation, "/volery/stop_recording"), "full")
    monkeypatch.undo()
    assert call_service(simulation, "/volery/start_recording", path="b.mcap").success


def test_the_end_of_a_simulation_ends_its_recording(simulate, flat_data, tmp_path):
    simulation = simulate(flat_data, recordings=tmp_path)
    call_service(simulation, "/volery/start_recording", path="a.bag")
    simulation.run(0.1)
    simulation.close()
    assert summarize(tmp_path / "a.bag").messages > 10


def test_kept_states(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.run(0.5)
    assert call_service(simulation, "/volery/save_snapshot", name="early").success
    simulation.run(0.5)
    assert call_service(simulation, "/volery/save_snapshot", name="late").success
    listed = call_service(simulation, "/volery/list_snapshots")
    assert list(listed.names) == ["early", "late"]
    assert [stamp.sec for stamp in listed.stamps] == [0, 1]
    assert call_service(simulation, "/volery/restore_snapshot", name="early").success
    assert simulation.time_s == 0.5
    assert call_service(simulation, "/volery/delete_snapshot", name="early").success
    refused(call_service(simulation, "/volery/restore_snapshot", name="early"), "late")
    refused(call_service(simulation, "/volery/delete_snapshot", name="early"))
    refused(call_service(simulation, "/volery/save_snapshot", name=""), "characters")


def test_kept_states_are_bounded(simulate, flat_data):
    simulation = simulate(flat_data)
    for k in range(16):
        assert call_service(simulation, "/volery/save_snapshot", name=f"state {k}").success
    refused(call_service(simulation, "/volery/save_snapshot", name="one more"), "delete one")
    assert call_service(simulation, "/volery/save_snapshot", name="state 3").success


def test_what_follows_a_restore_is_the_same_again(simulate, flat_data):
    flat_data["uavs"][0]["on_start"] = "take_off"
    simulation = simulate(flat_data)
    simulation.diagnostics.enable_digest()
    simulation.run(0.5)
    call_service(simulation, "/volery/save_snapshot", name="there")
    simulation.run(0.5)
    first = simulation.diagnostics.digest()
    simulation.post(lambda: call_service(simulation, "/volery/restore_snapshot", name="there"))
    simulation.process_commands()
    simulation.run(0.5)
    assert simulation.diagnostics.digest() == first


def test_states_that_cannot_be_saved_are_reported(simulate, flat_data):
    simulation = simulate(flat_data)
    partner = simulation.clock.add_partner("other", period_s=0.1)
    refused(call_service(simulation, "/volery/save_snapshot", name="a"), "other")
    partner.leave()


def test_a_uav_is_reset(simulate, flat_data):
    simulation = simulate(flat_data)
    call_service(simulation, "/uav1/take_off")
    simulation.run(1.0)
    assert call_service(simulation, "/volery/reset_uav", name="uav1").success
    assert simulation.uavs["uav1"].mode.name == "LANDED"
    refused(call_service(simulation, "/volery/reset_uav", name="uav9"), "uav9")
