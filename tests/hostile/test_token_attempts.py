"""Wrong tokens by the hundred and in parallel: they wait for each other, the right token gets in.

Where PENALTY_S is an hour, a guess is answered only once its guesser has had his turn: so tests see
which client waits for which without a clock.
"""

import asyncio
import contextlib
import json
import select
import socket
import threading
import urllib.request

import pytest
from live_graph import LiveGraph
from patient_websockets import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.comms.addresses import Identity
from volery.comms.server.settings import RouterSettings
from volery.comms.server.tcp import CommsServer
from volery.comms.station.tcp import Station
from volery.core.token_attempts import TokenAttempts
from volery.server.auth import Tokens
from volery.server.page_server import PageServer
from volery.server.settings import PageSettings

TOKEN = "the right one"
TIMEOUT_S = 600.0
HOUR_S = 3600.0
HERE, ELSEWHERE = "127.0.0.1", "127.0.0.2"
"""Addresses of clients; both are of this machine, and count as two."""
ATTEMPTS = 30


# ---------------------------------------------------------------------------------- the mechanism


class Guesser:
    """Clients of the mechanism, with a log of what happened."""

    def __init__(self, penalty_s, **options):
        self.guesses = TokenAttempts(penalty_s, **options)
        self.log = []
        self.left = asyncio.Event()

    async def show(self, name, address, *, is_right=False):
        async with self.guesses.turn(address):
            self.log.append(name)
            if not is_right:
                await self.guesses.penalize(self.left.wait)

    def start(self, *arguments, **options):
        return asyncio.create_task(self.show(*arguments, **options))


async def settled():
    for _ in range(20):
        await asyncio.sleep(0)


def test_one_address_has_one_guess_at_a_time_and_delays_no_other():
    async def test():
        some = Guesser(HOUR_S)
        tasks = [some.start("wrong", HERE) for _ in range(200)]
        await settled()
        assert some.log == ["wrong"]
        await some.show("right", ELSEWHERE, is_right=True)
        assert some.log == ["wrong", "right"]
        some.left.set()  # clients that leave cost the others no time
        await asyncio.gather(*tasks)
        assert len(some.log) == 201
        assert some.guesses.num_waiting == 0

    asyncio.run(test())


def test_the_right_token_has_its_turn_among_wrong_ones_of_its_own_address():
    async def test():
        some = Guesser(0.001)
        before = [some.start("wrong", HERE) for _ in range(50)]
        await settled()
        right = some.start("right", HERE, is_right=True)
        await settled()
        after = [some.start("later", HERE) for _ in range(50)]
        await asyncio.gather(*before, right, *after)
        assert some.log == ["wrong"] * 50 + ["right"] + ["later"] * 50

    asyncio.run(test())


def test_all_addresses_together_are_limited():
    async def test():
        some = Guesser(HOUR_S, max_penalties=5)
        tasks = [some.start("wrong", f"10.0.0.{k}") for k in range(50)]
        await settled()
        assert len(some.log) == 50  # checked once each ..
        again = [some.start("again", f"10.0.0.{k}") for k in range(50)]
        await settled()
        assert "again" not in some.log  # .. and the second guess waits for the first one's penalty
        await some.show("right", "10.0.1.1", is_right=True)
        for task in (*tasks, *again):
            task.cancel()
        await asyncio.gather(*tasks, *again, return_exceptions=True)
        assert some.guesses.num_waiting == 0

    asyncio.run(test())


def test_a_network_of_ipv6_addresses_counts_as_one():
    async def test():
        some = Guesser(HOUR_S)
        tasks = [some.start("wrong", f"2001:db8::{k:x}") for k in range(20)]
        await settled()
        assert some.log == ["wrong"]
        await some.show("right", "2001:db8:0:1::1", is_right=True)
        some.left.set()
        await asyncio.gather(*tasks)

    asyncio.run(test())


# ------------------------------------------------------------------------------------ the servers


@pytest.fixture
def slow(monkeypatch):
    """A guess holds the turn of its address until its guesser leaves."""
    monkeypatch.setattr("volery.core.token_attempts.PENALTY_S", HOUR_S)


@pytest.fixture
def attempts(slow, monkeypatch):
    """Those of the page's server."""
    made = TokenAttempts()
    monkeypatch.setattr("volery.server.auth_middleware.TokenAttempts", lambda: made)
    return made


@pytest.fixture
def page(attempts):
    with PageServer(PageSettings(port=0, tokens=Tokens(TOKEN, "viewers"))) as server:
        yield server


@pytest.fixture
def rosbridge(slow):
    live = LiveGraph()
    with BridgeHost(live.gateway) as bridges:
        server = RosbridgeServer(port=0, token=TOKEN)
        bridges.open(server)
        yield server
    live.close()


def request(port, path, *, source=HERE, bearer=None):
    """A connection that has requested a page, and not yet read the response."""
    sock = socket.create_connection(("127.0.0.1", port), TIMEOUT_S, source_address=(source, 0))
    header = "" if bearer is None else f"Authorization: Bearer {bearer}\r\n"
    sock.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n{header}\r\n".encode())
    return sock


def status_of(sock):
    with sock:
        return int(sock.recv(4096).split(b" ", 2)[1])


def is_unanswered(sock):
    return not select.select([sock], [], [], 0.0)[0]


@pytest.mark.parametrize("method", ["query", "bearer"])
def test_page(page, attempts, method):
    def show(token, source=HERE):
        if method == "bearer":
            return request(page.port, "/api/status", source=source, bearer=token)
        return request(page.port, f"/api/status?token={token.replace(' ', '+')}", source=source)

    guessing = [show(f"guess {k}") for k in range(ATTEMPTS)]
    assert status_of(show(TOKEN, ELSEWHERE)) == 200
    late = show(TOKEN)
    until_waiting(attempts, ATTEMPTS + 1)
    assert all(map(is_unanswered, guessing))  # in parallel they get no more than one by one
    for attempt in guessing:
        attempt.close()
    assert status_of(late) == 200


def test_a_cookie_never_waits(page):
    with urllib.request.urlopen(
        f"http://127.0.0.1:{page.port}/api/status?token=viewers", timeout=TIMEOUT_S
    ) as response:
        cookie = response.headers["Set-Cookie"].partition(";")[0]
    attempts = [request(page.port, f"/?token={k}") for k in range(ATTEMPTS)]
    plain = urllib.request.Request(
        f"http://127.0.0.1:{page.port}/api/status", headers={"Cookie": cookie}
    )
    with urllib.request.urlopen(plain, timeout=TIMEOUT_S) as response:
        assert json.load(response)["role"] == "viewer"
    for attempt in attempts:
        attempt.close()


def test_a_foreign_page_cannot_guess(page):
    foreign = {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}
    for token in ("guess", TOKEN.replace(" ", "+")):
        asked = urllib.request.Request(
            f"http://127.0.0.1:{page.port}/?token={token}", headers=foreign
        )
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(asked, timeout=TIMEOUT_S)


def socket_of(server, source=HERE):
    return socket.create_connection(
        ("127.0.0.1", server.port), TIMEOUT_S, source_address=(source, 0)
    )


def enter(server, token, method, source=HERE):
    """Connects and shows a token; whether it is the right one."""
    address = f"ws://127.0.0.1:{server.port}/"
    options = {"sock": socket_of(server, source), "open_timeout": TIMEOUT_S, "close_timeout": 0.1}
    try:
        if method == "query":
            address += f"?token={token.replace(' ', '+')}"
        elif method == "bearer":
            options["additional_headers"] = {"Authorization": f"Bearer {token}"}
        with connect(address, **options) as client:
            if method == "auth":
                client.send(json.dumps({"op": "auth", "token": token}))
            client.send(json.dumps({"op": "call_service", "service": "/rosapi/get_time"}))
            return '"result": true' in client.recv(TIMEOUT_S).replace('":true', '": true')
    except (InvalidStatus, ConnectionClosed):
        return False


@pytest.mark.parametrize("method", ["query", "bearer", "auth"])
def test_rosbridge(rosbridge, method, monkeypatch):
    monkeypatch.setattr("volery.bridges.rosbridge.server.HANDSHAKE_TIMEOUT_S", TIMEOUT_S)
    outcomes = []

    def attempt():
        with contextlib.suppress(OSError, EOFError, TimeoutError):
            outcomes.append(enter(rosbridge, "guess", method))

    first = socket_of(rosbridge)  # a plain one, which can be closed from here
    key = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    key += "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    first.sendall(f"GET /?token=first HTTP/1.1\r\nHost: localhost\r\n{key}".encode())
    until_waiting(rosbridge._attempts, 1)
    guessers = [threading.Thread(target=attempt, daemon=True) for _ in range(3)]
    for one in guessers:
        one.start()
    until_waiting(rosbridge._attempts, 4)
    assert outcomes == []
    assert enter(rosbridge, TOKEN, method, ELSEWHERE)
    monkeypatch.setattr(rosbridge._attempts, "_penalty_s", 0.001)
    first.close()  # its turn ends, and with it the wait of the others
    for one in guessers:
        one.join(TIMEOUT_S)
    assert outcomes == [False] * 3
    assert enter(rosbridge, TOKEN, method)


def until_waiting(attempts, count):
    waited = threading.Event()
    for _ in range(int(TIMEOUT_S / 0.02)):
        if attempts.num_waiting >= count:
            return
        waited.wait(0.02)
    raise AssertionError(f"{attempts.num_waiting} wait, not {count}")


def test_the_communication_server():
    async def test():
        server = CommsServer(RouterSettings(token=TOKEN), port=0)
        await server.start()
        penalize, at_once = server._attempts.penalize, []

        async def counted(gone=None):
            at_once.append(1 + sum(at_once[-1:]) if penalized else 1)
            penalized.append(None)
            await penalize(gone)
            penalized.pop()

        penalized = []
        server._attempts.penalize = counted
        guessers = [Station(Identity(k, 0), port=server.port, token="guess") for k in range(1, 9)]
        right = Station(Identity(9, 0), port=server.port, token=TOKEN)
        try:
            async with asyncio.timeout(TIMEOUT_S):
                outcomes = await asyncio.gather(
                    *(one.start() for one in (*guessers, right)), return_exceptions=True
                )
            assert ["token is wrong" in str(one) for one in outcomes] == [True] * 8 + [False]
            assert right.joined
            assert at_once == [1] * len(guessers)
        finally:
            for one in (*guessers, right):
                await one.stop()
            await server.stop()

    asyncio.run(test())
