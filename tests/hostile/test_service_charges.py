"""Every service that a viewer may call is charged to its caller, in a simulation and in playback.

The CPU clock of these tests advances by a millisecond at each call, so that nothing depends on
the machine.
"""

from __future__ import annotations

import itertools

import pytest
from whole_world import offer_rosapi, whole_data

from volery.bridges.logs.log_writer import create_log
from volery.graph.service_reply import ServiceReply
from volery.runtime.replay.log_player import LogPlayer
from volery.server.access_policy import READ_ONLY_SERVICES

TICK_S = 0.001
FLAT = {
    "name": "short",
    "duration_s": 1.0,
    "world": {"terrain": {"kind": "flat", "extent_m": 50.0}},
    "types": {"f450": {"sensors": [{"kind": "imu"}]}},
    "uavs": [{"type": "f450", "position_m": [0.0, 0.0]}],
}
IN_PLAYBACK = ("/volery/player/info",)


def charge(inbox, gateway, service, serve):
    """CPU time that a new client owes after one call of a service."""
    session = gateway.open("viewer")
    session.call(service, None, ServiceReply(lambda _: None, lambda _: None))
    queue = session._post.__self__
    assert queue.client is not None
    before_s = inbox._budget._owed_s.get(queue.client, 0.0)
    serve()
    assert session.waiting == 0
    owed_s = inbox._budget._owed_s.get(queue.client, 0.0) - before_s
    session.close()
    return owed_s


def stop_clocks(inbox):
    """CPU time advances at each call, and no client earns anything."""
    ticks = itertools.count()
    inbox._cpu_s = lambda: TICK_S * next(ticks)
    inbox._budget._now_s = lambda: inbox._budget._last_s


def uncharged(inbox, gateway, services, serve):
    stop_clocks(inbox)
    found = []
    for service in sorted(services):
        inbox._budget._owed_s.clear()
        if charge(inbox, gateway, service, serve) < TICK_S / 2:
            found.append(service)
    return found


def test_a_simulation_charges_what_viewers_call(simulate, tmp_path):
    simulation = simulate(whole_data(tmp_path))
    offer_rosapi(simulation)
    offered = {*simulation.graph.services()} & READ_ONLY_SERVICES
    assert {*READ_ONLY_SERVICES} - offered == {*IN_PLAYBACK}
    inbox = simulation._engine.inbox
    assert not uncharged(inbox, simulation.gateway, offered, simulation._engine.process_commands)


@pytest.fixture
def log(simulate, tmp_path):
    path = tmp_path / "short.mcap"
    simulation, recording = simulate(FLAT), create_log(path)
    simulation.graph.subscribe_all(recording.write)
    simulation.run(0.5)
    recording.close()
    return path


@pytest.mark.parametrize("speed", [None, 1.0])
def test_playback_charges_what_viewers_call(log, speed):
    with LogPlayer(log, speed=speed, loop=True) as player:
        offer_rosapi(player)
        player._is_late = True  # as where it does not keep its pace; else there is time to spare
        offered = {*player.graph.services()} & READ_ONLY_SERVICES
        assert {*IN_PLAYBACK} < offered
        assert not uncharged(player._inbox, player.gateway, offered, player._serve)


def test_a_player_counts_a_logs_messages_once(log, monkeypatch):
    with LogPlayer(log, paused=True) as player:
        first = player.describe()
        monkeypatch.setattr(player._playback.log, "counts", lambda: 1 / 0)
        assert player.describe() == first


def test_new_subscribers_share_a_budget_of_a_player(log):
    """What was published last is read from the log for each of them."""
    with LogPlayer(log, paused=True) as player:
        player._budget._now_s = lambda: player._budget._last_s
        calls = []
        show = player._playback.show_to_newcomers
        player._playback.show_to_newcomers = lambda: (calls.append(1), show())
        player.wait(0.0)
        assert calls
        player._budget.spend("new subscribers", 1.0)
        calls.clear()
        player.wait(0.0)
        assert not calls
