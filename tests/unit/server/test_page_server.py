"""The server itself: state, geometry, clients, and worlds that come and go behind it."""

import gzip
import json
import socket
import time
from contextlib import ExitStack, suppress

import numpy as np
import pytest
from live_graph import LiveGraph
from page_bench import TOKENS, VIEWER, Client, eventually, fetch, serving
from websockets.exceptions import ConnectionClosed

from volery.cli import pages
from volery.core.errors import BridgeError
from volery.graph.codecs.zero import zero_message
from volery.runtime.idle_server import IdleServer
from volery.server import page
from volery.server.access_policy import READ_ONLY_SERVICES
from volery.server.page_server import PageServer
from volery.server.settings import PageSettings


@pytest.fixture
def server(flight):
    with serving(flight.simulation) as server:
        yield server


def test_status_names_what_flies(server, flight):
    status = fetch(server, "/api/status").json
    assert status["state"] == "flying"
    assert status["scenario"] == "hover"
    assert (status["title"], status["unasked"]) == ("First hover", False)
    assert status["description"].startswith("One F450")
    assert status["world"] == flight.simulation.geometry.id
    assert status["role"] == "operator"
    assert status["token_needed"] is False
    assert status["message"] == ""


def test_a_first_scenario_by_default_is_unasked_until_another_one_flies(flight):
    def unasked(server):
        return fetch(server, "/api/status").json["unasked"]

    with serving(unasked=True) as server:
        assert unasked(server)
        server.building("hover")
        with server.showing(flight.simulation):
            assert unasked(server)
        server.building("longleaf")
        assert not unasked(server)


def test_states_between_worlds():
    idle = IdleServer(lambda _name: None)
    with serving() as server:
        assert fetch(server, "/api/status").json["state"] == "building"
        server.building("longleaf", "Pines.", "hover: no place")
        status = fetch(server, "/api/status").json
        assert (status["state"], status["scenario"]) == ("building", "longleaf")
        assert (status["message"], status["world"]) == ("hover: no place", None)
        with Client(server) as client:
            assert client.to_the_end() == 1012
        with server.showing(idle):
            assert fetch(server, "/api/status").json["state"] == "no_world"
            assert fetch(server, "/api/world.glb").status == 404
        with server.showing(idle, "longleaf: no place"):
            status = fetch(server, "/api/status").json
            assert (status["state"], status["message"]) == ("failed", "longleaf: no place")


def test_clients_take_part_in_the_graph(server):
    with Client(server, subprotocols=["rosbridge-cbor"]) as client:
        assert client.socket.subprotocol == "rosbridge-cbor"
        client.send("subscribe", topic="/uav2/odom", type="nav_msgs/msg/Odometry")
        odometry = client.until("publish", topic="/uav2/odom")["msg"]
        assert odometry["child_frame_id"] == "uav2/base_link"
        values, success = client.call("/rosapi/services")
        assert success
        assert "/volery/take_control" in values["services"]


def test_services_that_change_nothing_are_there(server, flight):
    with Client(server) as client:
        offered = set(client.call("/rosapi/services")[0]["services"])
    elsewhere = {"/volery/get_scenario_options", "/volery/get_grid_map", "/volery/player/info"}
    assert READ_ONLY_SERVICES - elsewhere <= offered


def test_new_clients_receive_the_world_id(server, flight):
    with Client(server) as client:
        client.send("subscribe", topic="/volery/world")
        world_id = client.until("publish", topic="/volery/world")["msg"]["data"]
        assert world_id == flight.simulation.geometry.id


def test_a_world_that_goes_sends_its_clients_to_the_next(flight):
    with serving() as server:
        with ExitStack() as end:
            with server.showing(flight.simulation):
                client = end.enter_context(Client(server))
                client.send("subscribe", topic="/uav1/odom")
                client.read()
            assert client.to_the_end() == 1012
        with server.showing(flight.simulation), Client(server) as client:
            client.send("subscribe", topic="/uav1/odom")
            client.read()
    names = [session.name for session in flight.simulation.gateway.sessions()]
    assert not [name for name in names if name.startswith("page")]


def test_a_viewer_sees_and_learns_why_not_more(flight):
    with (
        serving(flight.simulation, tokens=TOKENS) as server,
        Client(server, additional_headers={"Authorization": f"Bearer {VIEWER}"}) as client,
    ):
        client.send("subscribe", topic="/uav1/odom")
        client.until("publish", topic="/uav1/odom")
        assert client.call("/get_entities")[1]
        values, success = client.call("/uav1/land")
        assert (success, values) == (
            False,
            "a viewer may not call service /uav1/land; connect with the operators' token",
        )
        client.send("publish", topic="/uav1/cmd_vel", msg={}, id="p")
        refused = client.until("status", id="p")
        assert refused["level"] == "error"
        assert "viewer" in refused["msg"]


def test_one_operator_at_a_time(server, flight):
    operators = flight.simulation.operators
    with Client(server, "?operator=Ben") as ben:
        with Client(server, "?operator=Anna") as anna:
            values, _ = anna.call("/volery/take_control", uav="uav2")
            assert values == {"success": True, "message": "Anna steers uav2"}
            assert operators.operator_of("uav2") == "Anna"
            ben.send("subscribe", topic="/volery/vehicles")
            eventually(lambda: ben.until("publish")["msg"]["vehicles"][1]["operator"] == "Anna")
            values, success = ben.call("/uav2/hold")
            assert (success, values) == (False, "uav2 is held by Anna, who can hand it over")
            values, success = ben.call("/volery/take_control", uav="uav2")
            assert success
            assert values["success"] is False
            ben.send("publish", topic="/uav2/cmd_vel", msg={}, id="c")
            assert "held by Anna" in ben.until("status", id="c")["msg"]
            assert anna.call("/uav2/hold")[1]
            assert anna.call("/volery/hand_over", uav="uav2", to="Ben")[0]["success"]
            assert operators.operator_of("uav2") == "Ben"
            assert ben.call("/uav2/hold")[1]
            anna.call("/volery/take_control", uav="uav1")
        eventually(lambda: operators.operator_of("uav1") == "")  # Anna has left
        assert operators.operator_of("uav2") == "Ben"
    eventually(lambda: operators.operator_of("uav2") == "")


def test_the_world_is_fetched_once(server, flight):
    plain = fetch(server, "/api/world.glb")
    assert plain.headers["Content-Type"] == "model/gltf-binary"
    assert plain.body.startswith(b"glTF")
    zipped = fetch(server, "/api/world.glb", Accept_Encoding="gzip, br")
    assert zipped.headers["Content-Encoding"] == "gzip"
    assert gzip.decompress(zipped.body) == plain.body
    assert flight.simulation.geometry.id in plain.headers["ETag"]
    for response, how in ((plain, {}), (zipped, {"Accept_Encoding": "gzip"})):
        again = fetch(server, "/api/world.glb", If_None_Match=response.headers["ETag"], **how)
        assert (again.status, again.body) == (304, b"")
    assert fetch(server, "/api/world.glb", If_None_Match='"other"').status == 200
    assert plain.headers["Cache-Control"] == "no-cache"
    named = fetch(server, f"/api/world.glb?world={flight.simulation.geometry.id}")
    assert "immutable" in named.headers["Cache-Control"]
    other = fetch(server, "/api/world.glb?world=other")
    assert other.headers["Cache-Control"] == "no-cache"
    assert fetch(server, "/api/world.glb?detail=finest").status == 400
    assert fetch(server, "/api/world.glb?detail=coarse").status == 200


def test_a_message_that_is_too_large_ends_the_connection(server):
    megabyte = b"x" * 1024 * 1024
    with Client(server) as client:
        with suppress(ConnectionClosed):
            client.socket.send([megabyte] * 70, text=True)
        assert client.to_the_end() in (None, 1009)
    assert fetch(server, "/api/status").json["state"] == "flying"


def test_a_client_that_stops_reading_loses_its_own_messages_only():
    """Images of 1 MB: a client that reads receives all; the queue of another one drops them.

    How many fit into the buffers of the system and of the client's library depends on the load.
    """
    world = LiveGraph()
    image = zero_message("sensor_msgs/msg/Image")
    image.data = np.zeros(1_000_000, np.uint8)
    try:
        with (
            serving(world) as server,
            Client(server, close_timeout=0.1) as sleeper,
            Client(server) as reader,
        ):
            wanted = {"topic": "/image", "type": "sensor_msgs/msg/Image", "compression": "cbor"}
            sleeper.send("subscribe", queue_length=2, **wanted)
            reader.send("subscribe", queue_length=200, **wanted)
            eventually(lambda: len(boxes(world)) == 2)
            publisher = world.graph.advertise("/image", "sensor_msgs/msg/Image")
            for _ in range(400):
                world.do(lambda: publisher.publish(image))
                assert len(reader.socket.recv(60.0)) > 1_000_000
                served, stalled = sorted(boxes(world), key=lambda box: box.dropped)
                assert served.dropped == 0
                assert stalled.waiting <= 2
                if stalled.dropped > 40:
                    break
            assert stalled.dropped > 40
    finally:
        world.close()


def boxes(world):
    return [box for session in world.gateway.sessions() for box in session.queues]


def test_a_world_is_left_though_a_client_reads_no_more():
    """A stalled client does not keep the others from the next world."""
    world = LiveGraph()
    image = zero_message("sensor_msgs/msg/Image")
    image.data = np.zeros(5_000_000, np.uint8)
    wanted = {"topic": "/image", "type": "sensor_msgs/msg/Image", "compression": "cbor"}
    try:
        with serving() as server, ExitStack() as end:
            with server.showing(world):
                sleeper = end.enter_context(Client(server, close_timeout=0.1))
                sleeper.send("subscribe", queue_length=9, **wanted)
                eventually(lambda: boxes(world))
                publisher = world.graph.advertise("/image", "sensor_msgs/msg/Image")
                for _ in range(9):
                    world.do(lambda: publisher.publish(image))
                began = time.monotonic()
            assert time.monotonic() - began < 60.0
            assert not boxes(world)
    finally:
        world.close()


def test_a_taken_port_is_reported():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        server = PageServer(PageSettings(port=port))
        with pytest.raises(BridgeError, match=f"cannot listen on 127.0.0.1:{port}"):
            server.start()
        server.stop()


def test_without_a_build_the_page_says_how_to_make_one(server, monkeypatch, tmp_path):
    monkeypatch.setattr("volery.server.page.STATIC", tmp_path)
    response = fetch(server, "/")
    assert response.status == 200
    assert b"make web" in response.body
    (tmp_path / "index.html").write_text("<!doctype html><title>the page</title>")
    assert b"the page" in fetch(server, "/").body


def test_what_is_not_there_is_reported_as_json(server):
    for path, method, status in (
        ("/api/nothing", "GET", 404),
        ("/api/status", "DELETE", 405),
        ("/api/scenarios/nothing.jpg", "GET", 404),
    ):
        response = fetch(server, path, method)
        assert response.status == status
        assert json.loads(response.body)["error"]


def test_without_the_pages_build_nothing_breaks(monkeypatch, tmp_path, capsys):
    """Status and rosbridge are there; a line says at the start how the page is built."""
    monkeypatch.setattr(page, "STATIC", tmp_path / "static")
    with pages.serving(PageSettings(port=0)) as served:
        server = served._server
        assert "make web" in fetch(server, "/").body.decode()
        for path in ("/favicon.ico", "/assets/index.js"):
            assert fetch(server, path).status == 404
        assert fetch(server, "/api/status").status == 200
        (tmp_path / "static").mkdir()
        for name in ("index.html", "icon.svg"):
            (tmp_path / "static" / name).write_text(name)
        assert fetch(server, "/icon.svg").status == 200
    lines = capsys.readouterr().err.splitlines()
    assert lines[0].startswith("page    http://127.0.0.1:")
    assert lines[1] == ("warning: the page is not built: run `make web`; the other addresses work")
    assert len(lines) == 2
