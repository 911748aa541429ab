"""What tests of the page's server have in common: a flying simulation, and plain requests."""

import http.client
import json
import threading
import time
from contextlib import contextmanager

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from volery import Simulation, load_scenario
from volery.scenario import overrides
from volery.server.auth import Tokens
from volery.server.page_server import PageServer
from volery.server.settings import PageSettings

OPERATOR, VIEWER = "operators' token", "viewers' token"
TOKENS = Tokens(OPERATOR, VIEWER)


class Flight:
    """A simulation that runs in a thread of its own."""

    def __init__(self, scenario):
        self.simulation = Simulation(scenario, threads=1)
        self._thread = threading.Thread(target=self.simulation.run, kwargs={"speed": 1.0})
        self._thread.start()

    def close(self):
        self.simulation.clock.quit()
        self._thread.join()
        self.simulation.close()

    def do(self, action):
        """Have something done in the simulation's thread."""
        return self.simulation.post(action).result(60.0)


def hover(**options):
    return Flight(
        overrides.apply(load_scenario("hover"), uavs=2, seconds=1e5, seed=None, **options)
    )


@contextmanager
def serving(world=None, **settings):
    """A server on a free port, with clients in a world."""
    with PageServer(PageSettings(port=0, **settings)) as server:
        if world is None:
            yield server
            return
        with server.showing(world):
            yield server


class Response:
    def __init__(self, response):
        self.status = response.status
        self.headers = response.headers
        self.body = response.read()

    @property
    def json(self):
        return json.loads(self.body)

    @property
    def error(self):
        return self.json["error"]


def fetch(server, path, method="GET", body=None, **headers):
    """One request; the path goes out as it stands. Underlines in names of headers are dashes."""
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=900)
    try:
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, body, named)
        return Response(connection.getresponse())
    finally:
        connection.close()


class Client:
    """A rosbridge client made of nothing but a WebSocket."""

    def __init__(self, server, query="", **options):
        url = f"ws://127.0.0.1:{server.port}/rosbridge{query}"
        self._entry = connect(url, max_size=None, **options)

    def __enter__(self):
        self.socket = self._entry.__enter__()
        return self

    def __exit__(self, *exception):
        self._entry.__exit__(*exception)

    def send(self, op, **fields):
        self.socket.send(json.dumps({"op": op, **fields}))

    def read(self, timeout=60.0):
        return json.loads(self.socket.recv(timeout))

    def to_the_end(self):
        """The code with which the connection is closed."""
        try:
            while True:
                self.socket.recv(60.0)
        except ConnectionClosed as closed:
            return None if closed.rcvd is None else closed.rcvd.code

    def until(self, op, **fields):
        """The next operation of that kind; others are passed over."""
        wanted = {"op": op, **fields}
        while True:
            found = self.read()
            if all(found.get(key) == value for key, value in wanted.items()):
                return found

    def call(self, service, **args):
        """Values of a response, and whether it is one."""
        self.send("call_service", service=service, args=args, id=service)
        found = self.until("service_response", id=service)
        return found["values"], found["result"]


def eventually(condition, seconds=60.0):
    """Wait until something is true."""
    end = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)
    return found
