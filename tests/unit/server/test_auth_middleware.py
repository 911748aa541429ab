"""Unauthorized clients are refused: names, pages, tokens, paths."""

import socket

import pytest
from page_bench import OPERATOR, TOKENS, VIEWER, Client, fetch, serving
from websockets.exceptions import InvalidStatus

ORIGIN = "https://sim.example.org"


@pytest.fixture(scope="module")
def server(flight):
    with serving(flight.simulation, origins=(ORIGIN,)) as server:
        yield server


@pytest.fixture(scope="module")
def locked(flight):
    with serving(flight.simulation, tokens=TOKENS) as server:
        yield server


def quoted(token):
    return token.replace(" ", "%20").replace("'", "%27")


def test_every_response_states_its_use_for_browsers(server):
    for path in ("/", "/api/status", "/nothing", "/api/world.glb"):
        response = fetch(server, path)
        policy = response.headers["Content-Security-Policy"]
        assert "default-src 'self'" in policy
        assert "frame-ancestors 'self'" in policy
        assert "unsafe-eval" not in policy
        assert response.headers["X-Content-Type-Options"] == "nosniff"
        assert response.headers["Cross-Origin-Resource-Policy"] == "same-origin"


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("localhost:8080", 200),
        ("127.0.0.1", 200),
        ("[::1]:80", 200),
        ("sim.example.org", 200),  # listed, as that of a reverse proxy
        ("rebound.example", 421),
        ("127.0.0.1.rebound.example:8080", 421),
        ("", 421),
    ],
)
def test_names_that_pretend_to_be_this_machine(server, host, status):
    assert fetch(server, "/api/status", Host=host).status == status


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 400),  # a program: accepted, then refused since `kind` is missing
        ({"Origin": "http://localhost:8080"}, 400),
        ({"Origin": ORIGIN}, 400),
        ({"Origin": "https://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Sec_Fetch_Site": "cross-site"}, 403),
        ({"Sec_Fetch_Site": "same-origin"}, 400),
    ],
)
def test_foreign_pages_bring_no_files(server, headers, status):
    response = fetch(server, "/api/uploads", "POST", b"0,1", **headers)
    assert response.status == status
    assert response.error


def test_foreign_pages_do_not_reach_the_graph(server, caplog):
    with pytest.raises(InvalidStatus) as refused, Client(server, origin="https://evil.example"):
        pass
    assert refused.value.response.status_code == 403
    assert b"--origin" in refused.value.response.body
    with Client(server, origin=ORIGIN):
        pass
    assert not caplog.records  # a refusal is no problem of the server's


def test_without_a_token_there_is_the_page_and_little_more(locked):
    assert fetch(locked, "/").status == 200
    response = fetch(locked, "/api/status")
    assert response.status == 200
    assert response.json["token_needed"] is True
    assert response.json["role"] is None
    assert response.json["scenario"] is None
    for path in ("/api/world.glb", "/api/scenarios", "/api/recordings", "/api/recordings/a.mcap"):
        assert fetch(locked, path).status == 401
    with pytest.raises(InvalidStatus) as refused, Client(locked):
        pass
    assert refused.value.response.status_code == 401


@pytest.mark.parametrize(("token", "role"), [(OPERATOR, "operator"), (VIEWER, "viewer")])
def test_a_token_opens_and_a_cookie_keeps_open(locked, token, role):
    shown = fetch(locked, f"/?token={quoted(token)}")
    cookie = shown.headers["Set-Cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert "Path" not in cookie  # so that it holds below the prefix of a proxy
    assert token not in cookie
    kept = cookie.split(";")[0]
    assert fetch(locked, "/api/status", Cookie=kept).json["role"] == role
    assert fetch(locked, "/api/scenarios", Cookie=kept).status == 200
    bearer = fetch(locked, "/api/status", Authorization=f"Bearer {token}")
    assert bearer.json["role"] == role
    assert bearer.json["token_needed"] is False
    with Client(locked, additional_headers={"Cookie": kept}):
        pass
    with Client(locked, f"?token={quoted(token)}"):
        pass


def test_wrong_tokens_are_refused(locked):
    assert fetch(locked, "/api/status?token=wrong").status == 401
    assert fetch(locked, "/rosbridge?token=wrong").status == 401
    assert fetch(locked, "/api/status", Authorization="Bearer wrong").status == 401
    assert fetch(locked, "/api/world.glb", Cookie=f"volery_{locked.port}=operator-00").status == 401


def test_the_page_itself_opens_with_a_wrong_token_and_gives_no_right(locked):
    response = fetch(locked, "/?token=wrong")
    assert response.status != 401  # people get the page, which asks for another one
    assert "Set-Cookie" not in response.headers


def test_a_viewer_brings_no_files(locked):
    for path in ("/api/uploads?kind=forest&name=a.csv", "/api/recordings?name=a.mcap"):
        response = fetch(locked, path, "POST", b"x", Authorization=f"Bearer {VIEWER}")
        assert response.status == 403
        assert "viewer" in response.error


@pytest.mark.parametrize(
    "path",
    [
        "/../app.py",
        "/assets/../../app.py",
        "/%2e%2e/app.py",
        "/..%2fapp.py",
        "//etc/passwd",
        "/api/scenarios/..%2f..%2fapp.jpg",
        "/api/recordings/..%2f..%2fpyproject.toml",
        "/api/recordings/%2fetc%2fpasswd",
        "/%00",
    ],
)
def test_no_path_leaves_its_folder(server, path):
    response = fetch(server, path)
    assert response.status in (400, 404)
    assert b"import" not in response.body


def test_what_is_no_http_is_no_problem(server):
    with socket.create_connection(("127.0.0.1", server.port), timeout=60.0) as plug:
        plug.sendall(b"\x16\x03\x01 hello\r\n\r\n")
        plug.recv(100)
    assert fetch(server, "/api/status").status == 200
