"""Below the prefix of a reverse proxy that strips it: all addresses are relative."""

import re
import socket
import threading
from contextlib import contextmanager, suppress
from types import SimpleNamespace
from urllib.parse import urljoin, urlsplit

import pytest
from page_bench import OPERATOR, TOKENS, fetch, serving
from websockets.sync.client import connect

PREFIX = "/lab/sim1"


@contextmanager
def proxied(port):
    """A proxy for one request a connection, upgraded ones included."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def pipe(source, target):
            with suppress(OSError):
                while data := source.recv(65536):
                    target.sendall(data)
            with suppress(OSError):
                target.shutdown(socket.SHUT_WR)

        def serve(client):
            head = b""
            while b"\r\n\r\n" not in head:
                head += client.recv(65536)
            with client, socket.create_connection(("127.0.0.1", port)) as behind:
                behind.sendall(head.replace(f" {PREFIX}/".encode(), b" /", 1))
                up = threading.Thread(target=pipe, args=(client, behind))
                up.start()
                pipe(behind, client)
                up.join()

        def run():
            with suppress(OSError):
                while True:
                    client, _ = listening.accept()
                    threading.Thread(target=serve, args=(client,), daemon=True).start()

        thread = threading.Thread(target=run, daemon=True)
        thread.start()
        yield listening.getsockname()[1]
        listening.shutdown(socket.SHUT_RDWR)
    thread.join()


@pytest.fixture(scope="module")
def server(flight):
    with serving(flight.simulation, tokens=TOKENS) as server, proxied(server.port) as port:
        yield SimpleNamespace(port=port, own=server.port)


def get(server, path, **headers):
    return fetch(server, path, Connection="close", **headers)


def test_the_page_and_all_it_asks_for_are_found(server):
    shown = get(server, f"{PREFIX}/", Authorization=f"Bearer {OPERATOR}")
    page = f"http://127.0.0.1:{server.port}{PREFIX}/"
    for address in re.findall(rb'(?:href|src)="([^"]+)"', shown.body):
        assert urljoin(page, address.decode()).startswith(page), address
    cookie = shown.headers["Set-Cookie"].split(";")[0]
    status = get(server, f"{PREFIX}/api/status", Cookie=cookie)
    assert status.json["role"] == "operator"
    assert get(server, f"{PREFIX}/api/world.glb", Cookie=cookie).body.startswith(b"glTF")
    (card, *_) = get(server, f"{PREFIX}/api/scenarios", Cookie=cookie).json
    image = urlsplit(urljoin(page, card["picture"])).path
    assert image.startswith(PREFIX)
    assert get(server, image, Cookie=cookie).status == 200
    url = f"ws://127.0.0.1:{server.port}{PREFIX}/rosbridge"
    with connect(url, additional_headers={"Cookie": cookie}) as client:
        client.send('{"op": "subscribe", "topic": "/uav1/odom"}')
        assert '"op":"publish"' in client.recv(60.0)
