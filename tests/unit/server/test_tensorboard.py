"""TensorBoard inside the page: its process, and what the server passes on to it."""

import http.client
import sys
import urllib.request
from pathlib import Path

import pytest
from page_bench import OPERATOR, TOKENS, VIEWER, eventually, fetch, serving

from volery.core.errors import VoleryError
from volery.server import page_server
from volery.server.tensorboard import route, upstream
from volery.server.tensorboard.process import TensorBoardProcess, tensorboard_command

FAKE = [sys.executable, "-P", str(Path(__file__).with_name("fake_tensorboard.py"))]
AS_OPERATOR = {"Authorization": f"Bearer {OPERATOR}"}
SERIES = "/tensorboard/experiment/defaultExperimentId/data/plugin/timeseries/timeSeries"


def serve(monkeypatch, folder, **settings):
    monkeypatch.setattr(page_server, "tensorboard_command", lambda _: FAKE)
    return serving(tensorboard=folder, **settings)


@pytest.fixture(scope="module")
def server():
    with pytest.MonkeyPatch.context() as patch, serve(patch, Path(), tokens=TOKENS) as server:
        yield server


@pytest.mark.parametrize("token", [OPERATOR, VIEWER])
def test_operators_and_viewers_may_look(server, token):
    shown = fetch(server, f"{SERIES}?tag=a%20b&run=", Authorization=f"Bearer {token}")
    assert shown.status == 200
    assert shown.json["target"] == f"{SERIES}?tag=a+b&run="


def test_nothing_secret_is_passed_on_and_nothing_foreign_comes_back(server):
    query = "?token=operators%27+token&tag=a"
    shown = fetch(
        server, f"/tensorboard/data/runs{query}", Cookie="a=b", Accept="text/x", X_Other="1"
    )
    assert shown.json["target"] == "/tensorboard/data/runs?tag=a"
    assert set(shown.json["headers"]) == {"host", "connection", "accept", "accept-encoding"}
    assert shown.json["headers"]["host"].startswith("127.0.0.1:")
    assert "volery=1" not in shown.headers.get_all("Set-Cookie")
    for name in ("Keep-Alive", "Location", "Access-Control-Allow-Origin"):
        assert name not in shown.headers
    assert shown.headers["X-Frame-Options"] == "SAMEORIGIN"
    assert "default-src 'self'" in shown.headers["Content-Security-Policy"]
    assert "unsafe-eval" not in shown.headers["Content-Security-Policy"]
    assert shown.headers["Cache-Control"] == "no-store"


def test_its_page_has_a_policy_of_its_own(server):
    shown = fetch(server, "/tensorboard/?tensorboardColab=true", **AS_OPERATOR)
    policy = shown.headers.get_all("Content-Security-Policy")
    assert len(policy) == 1
    assert "'unsafe-eval'" in policy[0]
    assert "frame-ancestors 'self'" in policy[0]


@pytest.mark.parametrize("path", ["/tensorboard", "/tensorboard/", "/tensorboard/?tag=a"])
def test_its_page_reads_by_get_only_below_any_prefix(server, path):
    moved = fetch(server, path, **AS_OPERATOR)
    folder = "tensorboard/" if path == "/tensorboard" else ""
    assert moved.status == 307
    assert moved.headers["Location"] == f"{folder}?tensorboardColab=true"


@pytest.mark.parametrize("path", ["/tensorboard", "/tensorboard/", SERIES, "/%74ensorboard/a"])
def test_without_a_token_there_is_nothing(server, path):
    assert fetch(server, path).status == 401
    assert fetch(server, path, Cookie=f"volery_{server.port}=operator-0").status == 401


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "HEAD", "OPTIONS"])
@pytest.mark.parametrize("token", [OPERATOR, VIEWER])
def test_there_is_nothing_but_get(server, method, token):
    asked = fetch(server, SERIES, method, Authorization=f"Bearer {token}")
    assert asked.status == 405


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/tensorboard/data/plugin/profile/capture_profile", 403),
        ("/tensorboard/data/plugin/projector/runs", 403),
        ("/tensorboard/experiment/plugin/data/plugin/profile/a", 403),
        ("/tensorboard/data%2Fplugin%2Fprofile", 403),
        ("/tensorboard/../api/status", 404),
        ("/tensorboard//data/runs", 404),
        ("/tensorboard/data/runs%3Fa", 404),
        ("/tensorboard/%0d%0aX:1", 404),
        ("/tensorboard/%C3%A4", 404),
        ("/tensorboards", 404),
    ],
)
def test_other_addresses_are_refused(server, path, status):
    assert fetch(server, path, **AS_OPERATOR).status == status


def test_errors_of_tensorboard_come_through(server):
    assert fetch(server, "/tensorboard/missing", **AS_OPERATOR).status == 404


def test_a_response_has_a_limit(server, monkeypatch):
    refused = fetch(server, "/tensorboard/huge", **AS_OPERATOR)
    assert refused.status == 502
    assert "64 MB" in refused.error
    monkeypatch.setattr(upstream, "MAX_BODY_BYTES", 1 << 20)
    with pytest.raises(http.client.IncompleteRead):
        fetch(server, "/tensorboard/endless", **AS_OPERATOR)


def test_a_response_that_breaks_off_does_so_for_the_client(server):
    with pytest.raises(http.client.IncompleteRead):
        fetch(server, "/tensorboard/short", **AS_OPERATOR)


def test_there_is_a_limit_of_requests(server, monkeypatch):
    monkeypatch.setattr(route, "_MAX_REQUESTS", 0)
    assert fetch(server, "/tensorboard/data/runs", **AS_OPERATOR).status == 503


def test_the_status_says_whether_there_is_one(server):
    assert fetch(server, "/api/status", **AS_OPERATOR).json["tensorboard"] is True
    assert fetch(server, "/api/status").json["tensorboard"] is False
    with serving() as other:
        assert fetch(other, "/api/status").json["tensorboard"] is False
        refused = fetch(other, "/tensorboard/")
    assert refused.status == 404
    assert "--tensorboard DIR" in refused.error


def test_a_tensorboard_that_ended_is_502(monkeypatch, tmp_path):
    with serve(monkeypatch, tmp_path) as server:
        broken = fetch(server, "/tensorboard/gone")
        assert broken.status == 502
        assert broken.error.startswith("TensorBoard does not answer")
        eventually(lambda: "has ended" in fetch(server, "/tensorboard/data/runs").error)


def test_it_ends_with_the_server(monkeypatch, tmp_path):
    with serve(monkeypatch, tmp_path) as server:
        port = server._site.tensorboard.port
        assert fetch(server, "/tensorboard/data/runs").status == 200
    with pytest.raises(ConnectionRefusedError):
        http.client.HTTPConnection("127.0.0.1", port, timeout=60).request("GET", "/")


def test_it_ends_with_its_parent_and_does_not_see_the_tokens(monkeypatch):
    monkeypatch.setenv("VOLERY_TOKEN", "secret")
    command = [sys.executable, "-c", "import os, sys; sys.exit(str(sorted(os.environ)))"]
    with pytest.raises(VoleryError) as caught:
        TensorBoardProcess(command).start()
    assert "PATH" in str(caught.value)
    assert "VOLERY_TOKEN" not in str(caught.value)
    process = TensorBoardProcess(FAKE)
    process.start()
    process._process.stdin.close()  # as the death of the parent does
    eventually(lambda: process.port is None)
    process.stop()


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("broken", "ended during its start; its last output: no event files / at all"),
        ("silent", "did not answer within 0.5 s; its last output: none"),
        ("failing", "answers with HTTP status 500"),
    ],
)
def test_what_does_not_start_says_why(how, words):
    process = TensorBoardProcess([*FAKE, how], starting_s=0.5 if how == "silent" else 60.0)
    with pytest.raises(VoleryError, match="TensorBoard") as caught:
        process.start()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert process.port is None


def test_a_folder_must_exist(tmp_path):
    with pytest.raises(VoleryError, match=r"--tensorboard .*nowhere: no such folder"):
        tensorboard_command(tmp_path / "nowhere")


@pytest.mark.slow
def test_the_real_one(tmp_path, monkeypatch):
    monkeypatch.setattr(page_server, "tensorboard_command", tensorboard_command)
    pytest.importorskip("tensorboard")
    writing = pytest.importorskip("tensorboard.summary.writer.event_file_writer")
    from tensorboard.compat.proto.event_pb2 import Event
    from tensorboard.compat.proto.summary_pb2 import Summary

    writer = writing.EventFileWriter(str(tmp_path / "hover"))
    value = Summary.Value(tag="success", simple_value=0.5)
    writer.add_event(Event(step=1, wall_time=1.0, summary=Summary(value=[value])))
    writer.close()
    with serving(tensorboard=tmp_path) as server:
        with urllib.request.urlopen(f"{server.url}tensorboard/") as page:
            assert page.url.endswith("?tensorboardColab=true")
            assert b"<title>TensorBoard" in page.read()
        eventually(lambda: fetch(server, "/tensorboard/data/runs").json == ["hover"])
        query = "?requests=%5B%7B%22plugin%22:%22scalars%22,%22tag%22:%22success%22%7D%5D"
        (series,) = fetch(server, SERIES + query).json
        assert series["runToSeries"]["hover"][0]["value"] == 0.5
        assert len(fetch(server, "/tensorboard/index.js").body) > 1_000_000
