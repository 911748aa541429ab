"""A log in the place of a simulation: played, put anywhere, steered by services; broken ones."""

from __future__ import annotations

import pytest
from fake_wall_clock import FakeWallClock

from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.records import LogWalk
from volery.core.errors import CommandError, RecordingError
from volery.graph import messages as m
from volery.graph.codecs.zero import zero_message
from volery.graph.service_reply import ServiceReply
from volery.runtime import Simulation
from volery.runtime.replay.log_player import LogPlayer
from volery.scenario.load import load_scenario

FORMATS = [".mcap", ".bag"]
SECONDS = 5.0
STOPPED, PLAYING, PAUSED = 0, 1, 2


@pytest.fixture(scope="module")
def flights(tmp_path_factory):
    """A hovering UAV for 5 s, as MCAP and bag."""
    folder = tmp_path_factory.mktemp("flights")
    paths = {suffix: folder / f"flight{suffix}" for suffix in FORMATS}
    logs = [create_log(path) for path in paths.values()]
    with Simulation(load_scenario("hover"), threads=1) as simulation:
        for log in logs:
            simulation.graph.subscribe_all(log.write)
        simulation.run(SECONDS)
    for log in logs:
        log.close()
    return paths


@pytest.fixture
def flight(flights):
    return flights[".mcap"]


class Visitor:
    """A client of a player, in the player's own thread."""

    def __init__(self, player):
        self.player = player
        self.session = player.gateway.open("visitor")

    def listen(self, topic):
        return self.session.subscribe(topic, depth=100_000, wake=lambda: None)

    def call(self, service, srvtype, **fields):
        request = zero_message(f"{srvtype}_Request")
        for name, value in fields.items():
            setattr(request, name, value)
        responses = []
        self.session.call(service, request, ServiceReply(responses.append, responses.append))
        self.player.wait(0.0)
        return responses[0]

    def ours(self, service, kind, **fields):
        return self.call(f"/volery/{service}", f"volery_interfaces/srv/{kind}", **fields)

    def put(self, state):
        message = zero_message("simulation_interfaces/msg/SimulationState")
        message.state = state
        service = "simulation_interfaces/srv/SetSimulationState"
        return self.call("/set_simulation_state", service, state=message).result.result


def rows_of(messages):
    return [(p.topic, p.msgtype, p.time_ns, p.cdr) for p in messages if p.topic != "/clock"]


def play_out(player):
    while not player.finished:
        player.wait(0.05)


@pytest.mark.parametrize("suffix", FORMATS)
def test_what_is_played_is_what_was_recorded(flights, suffix):
    """Every topic, time and byte, in the order of the log."""
    received = []
    with LogPlayer(flights[suffix], speed=None) as player:
        player.graph.subscribe_all(received.append)
        play_out(player)
        assert player.paused
    received = [p for p in received if not p.topic.startswith("/volery/player")]
    decoder = LogDecoder()
    expected = [
        (r.topic.topic, decoder.decode(r).msgtype, r.time_ns, m.Published("", *decoded).cdr)
        for r in LogWalk(flights[suffix])
        if r.topic.topic != "/clock"
        for decoded in [(decoder.decode(r).msgtype, 0, decoder.decode(r).message)]
    ]
    assert len(expected) > 1000
    assert rows_of(received) == expected


@pytest.mark.parametrize("suffix", FORMATS)
def test_anywhere_what_was_the_case_is_shown(flights, suffix):
    walked = list(LogWalk(flights[suffix]))
    decoder = LogDecoder()
    with LogPlayer(flights[suffix], paused=True) as player:
        visitor = Visitor(player)
        odom, weather = visitor.listen("/uav1/odom"), visitor.listen("/weather")
        static = visitor.listen("/tf_static")
        for second in (3.3, 0.7, 4.999, 2.5, 2.5):
            assert visitor.ours("player/seek", "Seek", time=second).success
            player.wait(0.0)
            last = {
                r.topic.topic: decoder.decode(r).message
                for r in walked
                if r.time_ns <= round(second * 1e9)
            }
            for queue in (odom, weather, static):
                (published,) = queue.take()[-1:]
                again = m.Published("", published.msgtype, 0, last[queue.topic])
                assert published.cdr == again.cdr
            assert player.time_s == second
        late = visitor.listen("/uav1/imu")
        player.wait(0.0)
        assert len(late.take()) == 1  # a late subscriber receives the last message, too


def test_what_follows_a_leap_is_the_rest_of_the_log(flight):
    received = []
    with LogPlayer(flight, speed=None) as player:
        player.graph.subscribe("/uav1/odom", received.append, m.Odometry)
        player.wait(0.0)
        play_out(player)
        whole = rows_of(received)
        player.seek(3.0)
        received.clear()
        player.graph.deliver()
        (backfilled,) = rows_of(received)
        received.clear()
        player.resume()
        play_out(player)
        rest = rows_of(received)
    assert whole[-len(rest) - 1 :] == [backfilled, *rest]
    assert rest[0][2] > 3_000_000_000 >= backfilled[2]


def test_only_what_is_listened_to_is_decoded(flight, monkeypatch):
    decoded = set()
    decode = LogDecoder.decode

    def watched(self, record):
        decoded.add(record.topic.topic)
        return decode(self, record)

    monkeypatch.setattr(LogDecoder, "decode", watched)
    with LogPlayer(flight, speed=None) as player:
        visitor = Visitor(player)
        queue = visitor.listen("/uav1/imu")
        play_out(player)
        assert len(queue.take()) > 900
    assert decoded == {"/uav1/imu", "/tf_static", "/weather", "/volery/scenario"}


@pytest.fixture
def wall(monkeypatch):
    clock = FakeWallClock()
    for module in ("log_player", "playback_control"):
        monkeypatch.setattr(f"volery.runtime.replay.{module}.time", clock.time)
    return clock


def test_it_keeps_the_time_that_is_asked_for(flight, wall, monkeypatch):
    with LogPlayer(flight, speed=4.0) as player:
        monkeypatch.setattr(player._inbox, "wait", wall.wait)
        visitor = Visitor(player)
        clock, state = visitor.listen("/clock"), visitor.listen("/volery/player/state")
        begun_s = wall.now_s
        player.run(0.5)
        assert player.time_s == pytest.approx(4.0 * 0.5, abs=0.1)
        stamps = [p.message.clock.sec + p.message.clock.nanosec / 1e9 for p in clock.take()]
        assert stamps == sorted(stamps)
        assert 10 < len(stamps) < 40
        states = [p.message for p in state.take()]
        assert 3 <= len(states) <= 8
        assert {s.state for s in states} == {PLAYING}
        assert (states[-1].start, states[-1].speed) == (0.0, 4.0)
        assert states[-1].end == pytest.approx(SECONDS, abs=0.01)
        visitor.ours("set_speed", "SetSpeed", factor=0.0)
        play_out(player)
        assert wall.now_s - begun_s < 2.0  # at once, and not in the second that is left
        assert player.state == PAUSED


def test_services_steer_it(flight, wall, monkeypatch):
    with LogPlayer(flight, paused=True) as player:
        monkeypatch.setattr(player._inbox, "wait", wall.wait)
        visitor = Visitor(player)
        assert player.state == STOPPED
        assert visitor.put(PLAYING) == 1
        assert visitor.put(PLAYING) == 101
        player.wait(0.1)
        assert player.time_s == pytest.approx(0.1, abs=0.05)
        assert visitor.put(PAUSED) == 1
        here = player.time_s
        player.wait(0.05)
        assert player.time_s == here
        step = "simulation_interfaces/srv/StepSimulation"
        assert visitor.call("/step_simulation", step, steps=250).result.result == 1
        assert player.time_s == pytest.approx(here + 0.25, abs=1e-9)
        assert visitor.call("/step_simulation", step, steps=0).result.result == 4
        assert visitor.put(STOPPED) == 1
        assert (player.time_s, player.state) == (0.0, STOPPED)
        assert not visitor.ours("player/seek", "Seek", time=float("nan")).success
        visitor.ours("player/seek", "Seek", time=1e9)
        assert player.finished
        assert visitor.put(PLAYING) == 1  # from the end it restarts
        player.wait(0.02)
        assert player.time_s < SECONDS
        assert visitor.call("/step_simulation", step, steps=1).result.result == 3
        assert visitor.put(3) == 1
        assert player.quitting


def test_it_publishes_what_it_plays(flight):
    with LogPlayer(flight, paused=True) as player:
        visitor = Visitor(player)
        info = visitor.ours("player/info", "PlayerInfo")
        assert info.success
        assert (info.file, info.format, info.scenario) == ("flight.mcap", "mcap", "hover")
        assert info.size == flight.stat().st_size
        counts = dict(zip(info.topics, info.counts.tolist(), strict=True))
        assert counts["/uav1/imu"] == sum(r.topic.topic == "/uav1/imu" for r in LogWalk(flight))
        assert player.scenario.name == "hover"
        assert player.scenario.world == load_scenario("hover").world
        world = visitor.call("/get_current_world", "simulation_interfaces/srv/GetCurrentWorld")
        assert world.world.name == "hover"


def test_round_and_round(tmp_path):
    path = strings(tmp_path / "x.mcap", [0, 10, 20, 30])
    received = []
    with LogPlayer(path, speed=None, loop=True) as player:
        player.graph.subscribe("/a", received.append, m.String)
        for _ in range(12):
            player.wait(0.0)
        assert not player.paused
        visitor = Visitor(player)
        assert visitor.call("/volery/player/set_loop", "std_srvs/srv/SetBool", data=False).success
        play_out(player)
    texts = [p.message.data for p in received]
    assert len(texts) > 8
    assert texts[:8] == ["0", "1", "2", "3"] * 2


def strings(path, times_ms, end=True):
    log = create_log(path)
    for k, t in enumerate(times_ms):
        log.write(m.Published("/a", "std_msgs/msg/String", t * 1_000_000, m.String(str(k))))
    log.flush()
    if end:
        log.close()
    else:
        log.abort()
    return path


def test_a_flight_that_was_reset_is_one_line(tmp_path):
    """The clock is the log's own, the position goes on."""
    path = strings(tmp_path / "x.mcap", [0, 1000, 2000, 0, 500, 1000])
    received = []
    with LogPlayer(path, paused=True) as player:
        player.graph.subscribe("/a", received.append, m.String)
        player.wait(0.0)
        assert (player.start_s, player.end_s) == (0.0, 3.0)
        for second, text, clock in ((1.5, "1", 1.5), (2.6, "4", 0.6), (3.0, "5", 1.0)):
            player.seek(second)
            player.graph.deliver()
            assert received[-1].message.data == text
            assert player.graph.now_ns() == round(clock * 1e9)


@pytest.mark.parametrize("suffix", FORMATS)
def test_logs_that_were_cut_off_are_played_as_far_as_they_go(tmp_path, suffix):
    path = strings(tmp_path / f"x{suffix}", [0, 10, 20], end=False)
    received = []
    with LogPlayer(path, speed=None) as player:
        player.graph.subscribe("/a", received.append, m.String)
        play_out(player)
        assert "index" in player.describe()["problem"]
    assert [p.message.data for p in received] == ["0", "1", "2"]
    assert player.scenario is None


def test_what_cannot_be_played(tmp_path):
    path = tmp_path / "x.mcap"
    with pytest.raises(RecordingError, match="cannot read"):
        LogPlayer(path)
    create_log(path).close()
    with pytest.raises(RecordingError, match="no readable message"):
        LogPlayer(path)
    path.write_bytes(b"nonsense in a file")
    with pytest.raises(RecordingError, match="neither"):
        LogPlayer(path)
    path.unlink()
    strings(path, [0, 10])
    with pytest.raises(CommandError, match="speed"):
        LogPlayer(path, speed=-1.0)


@pytest.mark.parametrize("suffix", FORMATS)
def test_verdicts_of_the_whole_flight_hold_at_all_times(tmp_path, suffix):
    """They are the last message of the log; clients receive them from the start, and once."""
    path = tmp_path / f"judged{suffix}"
    log = create_log(path)
    verdicts = m.Published("/volery/verdicts", "std_msgs/msg/String", 2 * 10**9, m.String("[3]"))
    for second in range(3):
        log.write(m.Published("/count", "std_msgs/msg/Bool", second * 10**9, m.Bool(True)))
    log.write(verdicts)
    log.close()
    with LogPlayer(path, paused=True) as player:
        box = Visitor(player).listen("/volery/verdicts")
        player.wait(0.0)
        assert [published.message.data for published in box.take()] == ["[3]"]
        assert player.time_s == 0.0
        player.seek(1.5)
        player.set_speed(None)
        player.resume()
        play_out(player)
        player.wait(0.0)
        assert box.take() == []
