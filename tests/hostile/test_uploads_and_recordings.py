"""Names and files that operators bring: none reaches hidden files or takes minutes to check."""

from __future__ import annotations

import json
import math
import socket
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import pytest

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.core.errors import DataFileError, RecordingError, ScenarioError, VoleryError
from volery.core.toml_text import MAX_PARTS, parse_toml
from volery.runtime.services.recording import RecordingServices
from volery.scenario.data_file_bases import read_toml
from volery.scenario.load import load_scenario
from volery.server.uploads import scenario_builder
from volery.server.uploads.scenario_builder import toml_of
from volery.server.uploads.validation import text_of

sys.path.append(str(Path(__file__).parents[1] / "unit" / "server"))
from live_graph import LiveGraph
from page_bench import fetch, serving

# ------------------------------------------------------------------------------------- names


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    folder = tmp_path_factory.mktemp("recordings")
    with serving(uploads=folder / "uploads", recordings=folder) as made:
        yield made


def test_control_characters_in_an_uploads_name(server: Any) -> None:
    path = "/api/uploads?kind=grid_map&name=a%00b%1b%5b2J%0ac.csv"
    response = fetch(server, path, "POST", b"0,x\n")
    assert response.status == 422
    assert "'x'; allowed are 0 and 1" in response.error
    assert response.error.isprintable()


def test_control_characters_in_a_recordings_name(server: Any) -> None:
    response = fetch(server, "/api/recordings?name=a%00b.mcap", "POST", b"no log")
    assert response.status == 422
    assert response.error.isprintable()
    assert fetch(server, "/api/recordings/a%00b.mcap").status == 404


@pytest.mark.parametrize(
    "name",
    [".hidden.mcap", "a/.hidden.mcap", ".upload_x/a.mcap", "a/../.b/c.mcap", ".ssh/a.bag",
     "a\nb.mcap", "a\x1b[2J.mcap", "\u202ea.mcap"],
)  # fmt: skip
def test_hidden_files_are_not_recorded(name: str, tmp_path: Path) -> None:
    services = RecordingServices(cast("Any", None), tmp_path, cast("Any", None))
    with pytest.raises(RecordingError, match=r"hidden|control characters"):
        services._checked(name)
    assert services._checked("day/flight.mcap") == (tmp_path / "day" / "flight.mcap").resolve()


# -------------------------------------------------------------------------------------- TOML

DEEP = {
    "dotted key": "a." * 60_000 + "a = 1",
    "spaces": "a . " * 60_000 + "a = 1",
    "table": "[" + "a." * 60_000 + "a]",
    "list of tables": "[[" + "a." * 60_000 + "a]]",
    "quoted key": '"\\"a"." b".' * 20_000 + "a = 1",
    "literal key": "'a'." * 30_000 + "a = 1",
    "inline table": "t = {" + "a." * 60_000 + "a = 1}",
    "just too deep": "a." * MAX_PARTS + "a = 1",
    "lists": "a = " + "[" * 100_000,
    "inline tables": "a = " + "{a = " * 30_000,
}


@pytest.mark.parametrize("text", DEEP.values(), ids=DEEP)
def test_deep_toml_is_refused_before_it_is_parsed(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not text.startswith("a = "):
        monkeypatch.setattr(tomllib, "loads", _never)
    path = tmp_path / "scenario.toml"
    path.write_text(text)
    for read, error in (
        (load_scenario, ScenarioError),
        (read_toml, DataFileError),
        (lambda path: text_of(path, "name"), ScenarioError),
    ):
        reading = cast("Callable[[Path], object]", read)
        with pytest.raises(error, match="nested too deep"):
            reading(path)


def test_what_looks_deep_is_read() -> None:
    text = (
        f"p = [{'1.0, ' * 1000}]\n{'x.' * (MAX_PARTS - 1)}x = 1\n"
        f"q = '{'one. two, ' * 100}'\n[{'y.' * (MAX_PARTS - 1)}y]\n"
    )
    assert parse_toml(text) == tomllib.loads(text)


def _never(_text: str) -> dict[str, Any]:
    raise AssertionError("parsed")


# ---------------------------------------------------------------------------------- outlines


def star(corners: int, radius_deg: float = 0.003) -> list[list[float]]:
    ring = []
    for k in range(corners):
        radius = radius_deg * (1.0 if k % 2 else 0.5)
        angle = 2.0 * math.pi * k / corners
        ring.append([24.9 + radius * math.cos(angle), 60.1 + radius * math.sin(angle)])
    return [*ring, ring[0]]


def city(path: Path, *rings: list[list[float]]) -> Path:
    features = [
        {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": [r]}}
        for r in rings
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


@pytest.mark.parametrize(
    ("rings", "why"),
    [
        (lambda: [star(100_000)], "100001 corners; at most 100000 are allowed"),
        (lambda: [star(10_000)], "its walls are too dense: simplify the outlines"),
        (lambda: [star(50_000, 0.0003)], "its walls are too dense"),
        (lambda: [[[24.9, 60.1], [24.9, 60.11], [24.92, 60.11]] * 9000], "its walls are too long"),
        (lambda: [star(4, 0.002 + k * 1e-7) for k in range(1000)], "pairs of outlines overlap"),
    ],
    ids=["many", "spikes", "dense", "long", "overlapping"],
)
def test_outlines_that_take_minutes_are_refused(
    rings: Callable[[], list[list[list[float]]]],
    why: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if "overlap" in why:
        monkeypatch.setattr(scenario_builder, "MAX_CROWDING", 1e12)
    path = city(tmp_path / "city.geojson", *rings())
    with pytest.raises(VoleryError, match=why):
        toml_of("city", path, "yard", "yard.geojson")


def test_usual_outlines_are_accepted(tmp_path: Path) -> None:
    rings = [star(40, 0.0002 + 0.00001 * k) for k in range(9)]
    assert "[world.city]" in toml_of(
        "city", city(tmp_path / "city.geojson", *rings), "yard", "yard.geojson"
    )


def test_rings_without_corners_are_no_city(tmp_path: Path) -> None:
    with pytest.raises(DataFileError, match="holds no outline of a building"):
        toml_of("city", city(tmp_path / "city.geojson", []), "yard", "yard.geojson")


# ----------------------------------------------------------------------------------- names of hosts


def status_of(port: int, host: str, path: str = "/") -> int:
    """The status of a request for a WebSocket to which `host` is the server's name."""
    head = (
        f"GET {path} HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", port), timeout=60.0) as link:
        link.sendall(head.encode())
        return int(link.makefile("rb").readline().split()[1])


def test_rosbridge_answers_to_names_of_this_machine_only() -> None:
    """A web page whose name an attacker lets point to 127.0.0.1 (DNS rebinding)."""
    live = LiveGraph()
    with BridgeHost(live.gateway) as bridges:
        server = RosbridgeServer(port=0, origins=["https://studio.example.org:8443"])
        bridges.open(server)
        for host in ("rebound.example", f"rebound.example:{server.port}", "192.168.1.5:9090", ""):
            assert status_of(server.port, host) == 421
        for host in ("localhost", f"127.0.0.1:{server.port}", "[::1]:9090"):
            assert status_of(server.port, host) == 101
        assert status_of(server.port, "studio.example.org:8443") == 101
        with_token = RosbridgeServer(port=0, token="secret")
        bridges.open(with_token)
        assert status_of(with_token.port, "rebound.example", "/?token=secret") == 101
