"""Flight logs: what they hold, when they are made, and how MAVLink clients get them."""

import io
import os
import tempfile

import numpy as np
import pytest
from flying_bench import Station, fly
from pyulog import ULog

from volery.mavlink.autopilot.logs import log_storage
from volery.mavlink.autopilot.logs.log_storage import LogStorage

PERIODS_S = {
    "vehicle_attitude": 0.05,
    "vehicle_angular_velocity": 0.02,
    "vehicle_acceleration": 0.05,
    "vehicle_local_position": 0.1,
    "vehicle_global_position": 0.2,
    "vehicle_status": 0.2,
    "vehicle_land_detected": 0.2,
    "actuator_motors": 0.1,
}


@pytest.fixture
def flight():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        yield simulation, station


def entries(station, first=0, last=0xFFFF):
    """Answers to a list of logs."""
    before = len(station.of("LOG_ENTRY"))
    station.send("log_request_list", station.target, 1, first, last)
    station.seconds(0.1)
    return station.of("LOG_ENTRY")[before:]


def pieces(station, number, offset, count, seconds=0.6):
    """Answers to one request for data."""
    before = len(station.of("LOG_DATA"))
    station.send("log_request_data", station.target, 1, number, offset, count)
    station.seconds(seconds)
    return station.of("LOG_DATA")[before:]


def download(station, entry):
    """The bytes of a log, in requests as MAVSDK makes them."""
    data, chunk = b"", 512 * 90
    while len(data) < entry.size:
        count = min(chunk, entry.size - len(data))
        for piece in pieces(station, entry.id, len(data), count):
            assert (piece.id, piece.ofs) == (entry.id, len(data))
            data += bytes(piece.data[: piece.count])
    return data


def fly_once(station, height=3.0):
    """From arming to disarming; s of simulated time of both."""
    begun = station.simulation.time_s
    station.up(height)
    assert station.command(21) == 0
    for _ in range(60):
        station.seconds(0.5)
        if not station.armed:
            return begun, station.simulation.time_s
    raise AssertionError("it is not disarmed")


def topics_of(log):
    return {data.name: data.data for data in log.data_list}


def test_without_a_flight_there_are_no_logs(flight):
    _, station = flight
    (entry,) = entries(station)
    assert (entry.num_logs, entry.size) == (0, 0)
    assert pieces(station, 0, 0, 900) == []


def test_a_log_is_that_of_the_flight(flight):
    _, station = flight
    armed, disarmed = fly_once(station)
    (entry,) = entries(station)
    assert (entry.id, entry.num_logs, entry.last_log_num) == (0, 1, 0)
    raw = download(station, entry)
    assert len(raw) == entry.size
    log = ULog(io.BytesIO(raw))
    assert not log.file_corruption
    assert log.msg_info_dict["sys_name"] == "PX4"
    assert log.msg_info_dict["ver_sw"].startswith("Volery ")
    assert log.start_timestamp == pytest.approx(1e6 * armed, abs=0.05e6)
    assert log.last_timestamp == pytest.approx(1e6 * disarmed, abs=0.6e6)
    topics = topics_of(log)
    for name, period_s in PERIODS_S.items():
        times_s = 1e-6 * topics[name]["timestamp"]
        assert np.diff(times_s) == pytest.approx(period_s, abs=1e-5), name
    battery = topics["battery_status"]
    assert 0.9 < battery["remaining"][-1] < battery["remaining"][0] <= 1.0
    assert battery["voltage_v"][-1] > 5.0
    local = topics["vehicle_local_position"]
    assert local["z"].min() == pytest.approx(-3.0, abs=0.1)
    assert abs(local["x"]).max() < 0.2
    assert local["heading"][0] == pytest.approx(0.5 * np.pi, abs=0.01)  # east
    status = topics["vehicle_status"]
    assert set(status["nav_state"]) >= {17, 18}
    assert set(status["arming_state"]) == {2}
    attitude = topics["vehicle_attitude"]
    norms = np.linalg.norm([attitude[f"q[{k}]"] for k in range(4)], axis=0)
    assert norms == pytest.approx(1.0, abs=1e-5)
    acceleration = topics["vehicle_acceleration"]
    assert np.median(acceleration["xyz[2]"]) == pytest.approx(-9.81, abs=0.1)
    hover = np.median(topics["actuator_motors"]["control[0]"][20:60])
    assert hover == pytest.approx(log.initial_parameters["MPC_THR_HOVER"], abs=0.05)
    assert np.isnan(topics["actuator_motors"]["control[4]"]).all()
    position = topics["vehicle_global_position"]
    assert position["lat"][0] == pytest.approx(47.397742, abs=1e-5)
    assert "Takeoff detected" in [text.message for text in log.logged_messages]
    assert log.logged_messages[-1].message == "Disarmed by landing"


def test_a_log_holds_parameters_and_setpoints(flight):
    _, station = flight
    station.up()
    station.set("MPC_XY_CRUISE", 4.0)
    station.stream(0.5, station.send_position, 2.0, 1.0, -4.0)
    assert station.mode(6) == 0
    station.stream(2.0, station.send_position, 2.0, 1.0, -4.0)
    (entry,) = entries(station)
    log = ULog(io.BytesIO(download(station, entry)))
    assert log.initial_parameters["MPC_XY_CRUISE"] == 5.0
    assert log.initial_parameters["MIS_TAKEOFF_ALT"] == 3.0
    assert log.initial_parameters["SYS_FAILURE_EN"] == 0
    assert [(name, value) for _, name, value in log.changed_parameters] == [("MPC_XY_CRUISE", 4.0)]
    wanted = topics_of(log)["trajectory_setpoint"]
    assert [wanted[f"position[{k}]"][-1] for k in range(3)] == [2.0, 1.0, -4.0]


def test_each_flight_has_a_log_and_each_vehicle_its_own():
    simulation, station = fly(count=2)
    with simulation:
        station.seconds(0.1)
        other = Station(simulation, "uav2", link=8)
        fly_once(station, 1.0)
        fly_once(station, 1.0)
        listed = entries(station)
        assert [(entry.id, entry.num_logs) for entry in listed] == [(0, 2), (1, 2)]
        assert listed[0].time_utc < listed[1].time_utc
        assert entries(station, 1, 1)[0].id == 1
        assert entries(station, 7, 9)[0].id == 1  # as PX4
        (entry,) = entries(other)
        assert entry.num_logs == 0


@pytest.mark.parametrize(("mode", "num_logs"), [(-1, 0), (0, 0), (1, 1), (2, 1)])
def test_when_logs_begin_is_a_parameter(mode, num_logs):
    parameters = {"px4": {"SDLOG_MODE": mode}}
    simulation, station = fly(nodes=[{"node": "mavlink_autopilot", "parameters": parameters}])
    with simulation:
        station.seconds(0.1)
        assert entries(station)[0].num_logs == num_logs
        assert station.command(400, 1.0) == 0
        station.seconds(0.5)
        assert station.command(400, 0.0) == 0
        station.seconds(0.5)
        (entry,) = entries(station)
        assert entry.num_logs == (mode >= 0)
        station.seconds(0.5)
        grows = entries(station)[0].size > entry.size
        assert grows == (mode == 2)


def test_logs_are_erased_but_for_the_present_one(flight):
    _, station = flight
    fly_once(station, 1.0)
    station.up(1.0)
    assert len(entries(station)) == 2
    station.send("log_erase", station.target, 1)
    (entry,) = entries(station)
    assert entry.num_logs == 1
    assert not ULog(io.BytesIO(download(station, entry))).file_corruption
    fly_out = station.command(21)
    station.seconds(10.0)
    station.send("log_erase", station.target, 1)
    (entry,) = entries(station)
    assert (fly_out, entry.num_logs) == (0, 0)


@pytest.mark.parametrize(
    ("number", "offset", "count"),
    [(7, 0, 90), (0xFFFF, 0, 90), (0, 0xFFFFFFFF, 0xFFFFFFFF), (0, 10_000_000, 90), (0, 0, 0)],
)
def test_requests_out_of_range_get_no_data(flight, number, offset, count):
    _, station = flight
    fly_once(station, 1.0)
    entries(station)
    received = pieces(station, number, offset, count)
    assert len(received) == (number == 0)  # PX4 ends those of a log with an empty piece
    assert all(piece.count == 0 for piece in received)


def test_a_flood_of_requests_is_answered_at_the_rate_of_one(flight):
    _, station = flight
    fly_once(station, 1.0)
    (entry,) = entries(station)
    before = len(station.of("LOG_DATA"))
    for _ in range(50):
        for _ in range(20):
            station.send("log_request_data", station.target, 1, 0, 0, 0xFFFFFFFF)
        station.seconds(0.01)
    assert 0 < len(station.of("LOG_DATA")) - before <= 51 * 10
    station.send("log_request_end", station.target, 1)
    before = len(station.of("LOG_DATA"))
    station.seconds(0.2)
    assert len(station.of("LOG_DATA")) == before
    assert len(download(station, entry)) == entry.size


def test_links_share_the_rate(flight):
    simulation, station = flight
    fly_once(station, 1.0)
    others = [Station(simulation, link=link) for link in range(20, 30)]
    counts = []
    for one in (station, *others):
        entries(one)
    for one in (station, *others):
        one.send("log_request_data", 1, 1, 0, 0, 0xFFFFFFFF)
    station.seconds(0.11)
    counts = [len(one.of("LOG_DATA")) for one in (station, *others)]
    assert sum(counts) <= 10 * 12
    assert max(counts) - min(counts) <= 5


def test_a_closed_link_leaves_nothing(flight):
    simulation, station = flight
    fly_once(station, 1.0)
    entries(station)
    station.send("log_request_data", 1, 1, 0, 0, 0xFFFFFFFF)
    (autopilot,) = (node for node in simulation.vehicles.nodes if node.get_name() == "autopilot")
    autopilot.core.close_link(station.link)
    station.seconds(0.1)
    transfers = autopilot.core.context.log.transfers
    assert not transfers._requests
    assert not transfers._waiting


def test_logging_changes_no_flight():
    digests = []
    for mode in (-1, 2):
        parameters = {"px4": {"SDLOG_MODE": mode}}
        simulation, station = fly(nodes=[{"node": "mavlink_autopilot", "parameters": parameters}])
        with simulation:
            simulation.diagnostics.enable_digest()
            station.seconds(0.1)
            fly_once(station, 2.0)
            digests.append(simulation.diagnostics.digest())
    assert digests[0] == digests[1]


def test_a_restored_snapshot_begins_a_log(flight):
    simulation, station = flight
    station.up(1.0)
    kept = simulation.snapshot()
    station.seconds(1.0)
    simulation.restore(kept)
    station.seconds(0.5)
    first, second = entries(station)
    for entry in (first, second):
        log = ULog(io.BytesIO(download(station, entry)))
        times = topics_of(log)["vehicle_attitude"]["timestamp"].astype(np.int64)
        assert (np.diff(times) > 0).all()


# ------------------------------------------------------------------------------------ the storage


def fill(storage, num_bytes, value):
    storage.begin(value)
    for _ in range(num_bytes // 1000):
        assert storage.append(bytes((value,)) * 1000)


def test_new_logs_take_the_room_of_the_oldest():
    storage = LogStorage(1_000_000)
    for k in range(1, 8):
        fill(storage, 300_000, k)
    kept = [log.time_s for log in storage.logs]
    assert kept[-3:] == [5, 6, 7]
    for log in storage.logs[-3:]:
        data = storage.read(log, 0, 10**9)
        assert data == bytes((log.time_s,)) * 300_000
    old = storage.logs[0]
    fill(storage, 900_000, 9)
    assert storage.read(old, 0, 100) == b""
    assert os.fstat(storage._file).st_size <= 1_000_000
    storage.close()


def test_a_log_ends_where_the_storage_is_full():
    storage = LogStorage(200_000)
    storage.begin(0)
    assert sum(storage.append(bytes(1000)) for _ in range(300)) == 200
    assert len(storage.read(storage.logs[0], 0, 10**9)) == 200_000
    storage.close()


def test_logs_are_limited_in_number():
    storage = LogStorage()
    for k in range(100):
        storage.begin(k)
    assert [log.time_s for log in storage.logs] == list(range(100 - log_storage.MAX_LOGS, 100))
    storage.close()


def test_the_file_has_no_name_and_goes_with_its_owner(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    storage = LogStorage()
    fill(storage, 200_000, 1)
    number = storage._file
    assert os.fstat(number).st_size > 0
    assert list(tmp_path.iterdir()) == []
    del storage
    with pytest.raises(OSError, match="Bad file"):
        os.fstat(number)


def test_a_log_that_is_full_or_cannot_be_written_is_reported_once(flight, monkeypatch):
    simulation, station = flight
    (autopilot,) = (node for node in simulation.vehicles.nodes if node.get_name() == "autopilot")
    storage = autopilot.core.context.log.storage
    storage._capacity = 10_000
    fly_once(station, 1.0)
    assert station.texts.count("Flight log is full: logging ends") == 1
    (entry,) = entries(station)
    log = ULog(io.BytesIO(download(station, entry)))
    assert not log.file_corruption

    def full(*_):
        raise OSError(28, "No space left on device")

    storage.close()
    storage._capacity = log_storage.CAPACITY_BYTES
    monkeypatch.setattr(log_storage, "_BLOCK_BYTES", 1000)
    monkeypatch.setattr(os, "pwrite", full)
    fly_once(station, 1.0)
    text = "Flight log cannot be written: No space left on device"
    assert station.texts.count(text) == 1
    assert entries(station)[0].num_logs == 0
