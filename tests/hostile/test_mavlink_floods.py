"""MAVLink clients that send without end, or never read: bounded in time and memory."""

import contextlib
import socket
import threading

import pytest
from live_graph import LiveGraph

from volery.bridges.bridge_host import BridgeHost
from volery.mavlink.codec import dialect
from volery.mavlink.links.connection import MavlinkConnection
from volery.mavlink.links.rate_limits import FRAMES_PER_S, RateLimits
from volery.mavlink.links.tcp_bridge import MavlinkTcp
from volery.mavlink.links.udp_bridge import _UdpLink

TIMEOUT_S = 600.0


class Clock:
    now_s = 0.0

    def __call__(self):
        return self.now_s


def flood(accounts, clock, seconds, frames_per_s, step_s=0.01):
    """Frames that clients get through that send so many as long as they are read."""
    through, resume_s = dict.fromkeys(accounts, 0), dict.fromkeys(accounts, 0.0)
    end_s = clock.now_s + seconds
    while clock.now_s < end_s:
        for account in accounts:
            if clock.now_s >= resume_s[account]:
                frames = round(frames_per_s * step_s)
                through[account] += frames
                resume_s[account] = clock.now_s + account.charge(frames)
        clock.now_s += step_s
    return [through[account] for account in accounts]


def test_a_flood_is_held_to_the_rate():
    clock = Clock()
    limits = RateLimits(clock=clock)
    (through,) = flood([limits.account()], clock, 60.0, 10_000)
    assert through == pytest.approx(60.0 * FRAMES_PER_S, rel=0.1)


def test_floods_share_one_rate_and_others_notice_nothing():
    clock = Clock()
    limits = RateLimits(clock=clock)
    modest = limits.account()
    flooding = [limits.account() for _ in range(10)]
    begun = flood(flooding, clock, 10.0, 10_000)
    assert sum(begun) < 10.0 * FRAMES_PER_S + 10 * 1000
    for _ in range(100):
        assert modest.charge(1) == 0.0
        clock.now_s += 0.02
    for account in flooding:
        account.close()
    assert limits.rate == FRAMES_PER_S


def test_noise_costs_as_frames_do():
    clock = Clock()
    account = RateLimits(clock=clock).account()
    paused_s = sum(account.charge(0, 2048) for _ in range(100))
    assert paused_s > 1.0


def test_the_rate_grows_with_the_vehicles():
    limits = RateLimits(clock=Clock())
    limits.fit(3)
    assert limits.rate == FRAMES_PER_S
    limits.fit(50)
    assert limits.rate == 50 * 20.0


def test_a_client_that_floods_is_read_in_few_long_turns():
    account = RateLimits(clock=Clock()).account()
    assert account.charge(500) == 0.0
    assert account.charge(1) >= 0.05


class Vehicles:
    """Notes what a connection brings to the vehicles 1 to 3."""

    pause_s = 0.0

    def __init__(self):
        self.taken = []

    def send(self, system, link, profile, data):
        self.taken.append((system, data))

    def close_link(self, system, link):
        pass


def test_frames_that_come_together_reach_a_vehicle_as_one_message():
    vehicles = Vehicles()
    connection = MavlinkConnection(vehicles, 7, 0)
    for system in (1, 2, 3):
        connection.greet(system)
    vehicles.taken.clear()
    codec = dialect().MAVLink(None, 245, 190)
    to_second = dialect().MAVLink_param_request_list_message(2, 1).pack(codec)
    connection.take((heartbeat() + to_second) * 30)
    assert vehicles.taken == [
        (1, heartbeat() * 30),
        (2, (heartbeat() + to_second) * 30),
        (3, heartbeat() * 30),
    ]


def test_a_client_that_floods_no_more_is_read_again():
    clock = Clock()
    limits = RateLimits(clock=clock)
    account = limits.account()
    pause_s = account.charge(5000)
    clock.now_s += pause_s + 0.001
    assert account.charge() == 0.0
    assert limits.rate == FRAMES_PER_S


# ---------------------------------------------------------------------------------------- the port


@pytest.fixture
def bridge():
    live = LiveGraph()
    with BridgeHost(live.gateway) as bridges:
        made = MavlinkTcp(port=0)
        bridges.open(made)
        made.in_loop = lambda action: bridges.call(called(action))
        yield made
    live.close()


async def called(action):
    return action()


def heartbeat():
    codec = dialect().MAVLink(None, 245, 190)
    return codec.heartbeat_encode(6, 8, 0, 0, 0).pack(codec)


def connect(bridge):
    return socket.create_connection(("127.0.0.1", bridge.port), TIMEOUT_S)


def until(true):
    waited = threading.Event()
    for _ in range(int(TIMEOUT_S / 0.01)):
        if true():
            return
        waited.wait(0.01)
    raise AssertionError("it does not come true")


def test_what_is_sent_too_fast_stays_with_the_sender(bridge, monkeypatch):
    monkeypatch.setattr(bridge._intake, "_frames_per_s", 1e-3)
    sent, words = 0, heartbeat() * 1000
    with connect(bridge) as client:
        client.settimeout(0.3)
        with contextlib.suppress(TimeoutError):
            while sent < 256 << 20:
                sent += client.send(words)
        assert sent < 64 << 20  # what the two kernels' buffers hold
        with connect(bridge) as other:  # which is read as before
            until(lambda: len(bridge._clients) == 2)
            other.sendall(heartbeat())
            until(lambda: sum(one.connection.has_received for one in bridge._clients.values()) == 2)


def test_a_client_that_does_not_read_costs_no_memory(bridge):
    frames = heartbeat() * 50
    with connect(bridge):
        until(lambda: bridge._clients)
        (client,) = bridge._clients.values()
        for _ in range(100):
            bridge.in_loop(lambda: [bridge._send(-1, frames) for _ in range(1000)])
            size = bridge.in_loop(client.transport.get_write_buffer_size)
            assert size < 1 << 20


def test_idle_clients_give_way_and_those_that_speak_stay(bridge):
    with contextlib.ExitStack() as stack:
        speaking = stack.enter_context(connect(bridge))
        speaking.sendall(heartbeat())
        until(lambda: any(one.connection.has_received for one in bridge._clients.values()))
        for _ in range(100):
            stack.enter_context(connect(bridge))
        late = stack.enter_context(connect(bridge))
        late.sendall(heartbeat())
        until(lambda: sum(one.connection.has_received for one in bridge._clients.values()) == 2)
        assert len(bridge._clients) <= 40


@pytest.fixture
def udp_link():
    """Frames that a vehicle's UDP port has taken, its port, and the port of its agreed peer."""
    live = LiveGraph()
    vehicles = Vehicles()
    with BridgeHost(live.gateway) as bridges, contextlib.ExitStack() as stack:
        agreed = stack.enter_context(bound())
        peer = agreed.getsockname()

        async def opened():
            limits = RateLimits(frames_per_s=1e-3)
            return _UdpLink(vehicles, 1, 1, 0, peer, None, limits, for_peer=True)

        async def closed():
            link.close()

        link = bridges.call(opened())
        vehicles.taken.clear()
        yield vehicles.taken, link._socket.getsockname()[1], agreed, link
        bridges.call(closed())
    live.close()


def taken_bytes(taken):
    return b"".join(data for _, data in taken)


def bound():
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.bind(("127.0.0.1", 0))
    return sock


def test_a_flood_of_a_udp_port_does_not_crowd_out_its_agreed_peer(udp_link):
    taken, own, agreed, link = udp_link
    target = ("127.0.0.1", own)
    with bound() as flooding:
        for _ in range(5000):
            flooding.sendto(heartbeat(), target)
        until(lambda: link._inlets[0]._pause is not None)  # it is read no more
        before = len(taken_bytes(taken))
        for _ in range(20):
            agreed.sendto(heartbeat(), target)
        wanted = before + 20 * len(heartbeat())
        until(lambda: len(taken_bytes(taken)) >= wanted)
        assert len(taken_bytes(taken)) == wanted


def test_the_port_of_a_udp_link_stays_taken(udp_link):
    _, own, _, link = udp_link
    assert len(link._inlets) == 2
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        with pytest.raises(OSError, match="in use"):
            other.bind(("127.0.0.1", own))


def test_an_agreed_peer_that_left_may_come_again(udp_link):
    taken, own, agreed, link = udp_link
    target, peer = ("127.0.0.1", own), agreed.getsockname()
    agreed.sendto(heartbeat(), target)
    until(lambda: taken)
    agreed.close()
    for _ in range(20):
        link.send(heartbeat())  # which finds no receiver
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as again:
        again.bind(peer)
        before = len(taken)
        again.sendto(heartbeat(), target)
        until(lambda: len(taken) > before)
