"""Logs that are fetched, and logs that are brought."""

import os

import pytest
from page_bench import fetch, serving

from volery.bridges.logs.log_writer import create_log
from volery.graph import messages as m


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "recordings"
    folder.mkdir()
    return folder


@pytest.fixture
def server(folder):
    with serving(recordings=folder) as server:
        yield server


def write(path, seconds=2):
    log = create_log(path)
    for k in range(seconds + 1):
        time_ns = k * 1_000_000_000
        log.write(
            m.Published(
                "/clock", "rosgraph_msgs/msg/Clock", time_ns, m.Clock(m.time_from_ns(time_ns))
            )
        )
    log.close()
    os.utime(path, (1e9, 1e9))
    return path.read_bytes()


@pytest.mark.parametrize("kind", ["mcap", "bag"])
def test_logs_are_listed_and_fetched(server, folder, kind):
    content = write(folder / f"flight.{kind}")
    listing = fetch(server, "/api/recordings").json
    assert listing == [
        {"name": f"flight.{kind}", "bytes": len(content), "seconds": 2.0, "kind": kind}
    ]
    fetched = fetch(server, f"/api/recordings/flight.{kind}")
    assert fetched.body == content
    assert "attachment" in fetched.headers["Content-Disposition"]
    part = fetch(server, f"/api/recordings/flight.{kind}", Range="bytes=0-3")
    assert (part.status, part.body) == (206, content[:4])


def test_what_is_no_log_is_not_there(server, folder):
    (folder / "secret.txt").write_text("x")
    (folder / ".hidden.mcap").write_text("x")
    (folder / "uploads").mkdir()
    (folder / "link.mcap").symlink_to("/etc/hostname")
    assert fetch(server, "/api/recordings").json == []
    for name in ("secret.txt", ".hidden.mcap", "uploads", "link.mcap", "nothing.mcap"):
        assert fetch(server, f"/api/recordings/{name}").status == 404


def test_a_log_that_is_cut_off_has_no_length_or_that_of_its_rest(server, folder):
    content = write(folder / "cut.mcap")
    (folder / "cut.mcap").write_bytes(content[: len(content) // 2])
    (listing,) = fetch(server, "/api/recordings").json
    assert listing["bytes"] == len(content) // 2
    assert listing["seconds"] is None  # it may be growing


def test_logs_are_brought(server, folder, tmp_path):
    content = write(tmp_path / "own.mcap")
    for expected in ("my_flight.mcap", "my_flight_2.mcap"):
        response = fetch(server, "/api/recordings?name=../my%20flight.mcap", "POST", content)
        assert (response.status, response.json) == (201, {"name": expected})
        assert (folder / expected).read_bytes() == content
    for body, name, status in ((b"no log", "a.mcap", 422), (content, "a.zip", 415)):
        response = fetch(server, f"/api/recordings?name={name}", "POST", body)
        assert response.status == status
        assert response.error
        assert str(folder) not in response.error
    assert sorted(path.name for path in folder.iterdir()) == ["my_flight.mcap", "my_flight_2.mcap"]


def test_without_a_folder_there_are_none():
    with serving() as server:
        assert fetch(server, "/api/recordings").json == []
        assert fetch(server, "/api/recordings?name=a.mcap", "POST", b"x").status == 409
