"""Numbers that nothing real has: refused where they come in, or the run ends with what it was."""

from __future__ import annotations

import math
import re
import socket
import struct
import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

import volery
from volery.bridges.bridge_host import BridgeHost
from volery.bridges.logs.reader import summarize
from volery.bridges.rosbridge.server import RosbridgeServer
from volery.cli.app import app
from volery.core.errors import DataFileError, GraphError, ScenarioError, VoleryError
from volery.runtime import Simulation
from volery.scenario.load import load_scenario, parse_scenario
from volery.sensors.imu import ImuModel
from volery.vehicle.airframe import load_airframe
from volery.vehicle.identified import load_identified
from volery.world.mesh_files import read_mesh
from volery.world.weather.wind_field_files import read_wind_field

_FAR = {"kind": "external", "position_m": [1e300, 0.0]}
PACKAGE = Path(volery.__file__).parent
NAN, INF = math.nan, math.inf


def changed(tmp_path, file, key, value):
    """A copy of a data file of the package with another value for a key."""
    text = (PACKAGE / file).read_text(encoding="utf-8")
    other, count = re.subn(rf"(?m)^({key} = )[^#\n]*", rf"\g<1>{value} ", text, count=1)
    assert count == 1
    path = tmp_path / "changed.toml"
    path.write_text(other, encoding="utf-8")
    return path


# -------------------------------------------------------------------------------------- data files


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        (
            "drag_area_m2",
            "[20000.0, 0.02, 0.05]",
            r"20000 m2 is beyond 0 to 100 m2; given in mm2\?",
        ),
        ("mass_kg", "2065", r"body.mass_kg': 2065 kg is beyond .*; given in g\?"),
        ("mass_kg", "1e-308", "body.mass_kg"),
        ("inertia_kg_m2", "[1e300, 1e300, 1e300]", "body.inertia_kg_m2"),
        ("thrust_n_s2", "1e300", "rotors.thrust_n_s2"),
        ("rise_time_s", "1e-300", "rotors.rise_time_s"),
        ("rise_time_s", "12.5", r"given in ms\?"),
        ("feet_m", "[[130, 130, -120], [-130, 130, -120], [-130, -130, -120]]", r"given in mm\?"),
        ("capacity_ah", "52000", r"given in mAh\?"),
        ("speed_m_s", "1e200", "limits.speed_m_s"),
    ],
)
def test_airframes_with_absurd_numbers_are_refused(tmp_path, key, value, words):
    path = changed(tmp_path, "vehicle/airframes/f450.toml", key, value)
    with pytest.raises(DataFileError, match=words):
        load_airframe(path)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("damping", "653600"),
        ("natural_frequency_rad_s", "1e300"),
        ("drag_1_s", "[1e6, 1.0, 0.0]"),
        ("time_constant_s", "1e-300"),
    ],
)
def test_identified_models_with_absurd_numbers_are_refused(tmp_path, key, value):
    path = changed(tmp_path, "vehicle/identified/f450.toml", key, value)
    with pytest.raises(DataFileError, match=key):
        load_identified(str(path))


def test_sensor_models_with_absurd_numbers_are_refused(tmp_path):
    key = "gyro_noise_density_rad_s_sqrt_hz"
    path = changed(tmp_path, "sensors/models/adis16448.toml", key, "1e300")
    with pytest.raises(DataFileError, match=key):
        ImuModel.load(str(path))


def test_a_model_too_stiff_for_the_step_is_refused_before_the_flight(tmp_path, flat_data):
    path = changed(tmp_path, "vehicle/airframes/f450.toml", "drag_area_m2", "[99.0, 99.0, 99.0]")
    flat_data["types"]["f450"]["airframe"] = str(path)
    with pytest.raises(VoleryError, match=r"body.drag_area_m2 .* physics step .* higher physics"):
        Simulation(parse_scenario(flat_data), threads=1)


def test_an_stl_that_is_no_text_does_not_ask_for_a_module(tmp_path):
    path = tmp_path / "x.stl"
    path.write_bytes(b"\xff" * 80 + struct.pack("<I", 7) + b"\xfe" * 33)
    with pytest.raises(DataFileError, match="header announces 7 triangles, 434 bytes; it has 117"):
        read_mesh(path)


def test_a_wind_field_that_unpacks_to_too_much_is_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr("volery.world.weather.wind_field_files._MAX_BYTES", 1_000_000)
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("velocity_m_s.npy", bytes(20_000_000))
    with pytest.raises(DataFileError, match="unpacks to 20 MB; 1 are allowed"):
        read_wind_field(path)


# --------------------------------------------------------------------------------------- scenarios


@pytest.mark.parametrize(
    "world",
    [
        {"terrain": {"kind": "flat", "extent_m": 1e308}},
        {"terrain": {"kind": "flat", "height_m": -1e300}},
        {"forest": {"kind": "procedural", "region_m": [0, 0, 1e308, 1e308], "trees": 1}},
        {
            "forest": {
                "kind": "procedural",
                "region_m": [0, 0, 50, 50],
                "trees": 2,
                "minimum_spacing_m": 1e-308,
                "species": {"broadleaf": 1.0},
            }
        },
        {"actors": [{"name": "c", "shape": "car", "motion": _FAR}]},
        {"gnss_denied_areas": [{"kind": "box", "region_m": [-1e308, -1e308, 1e308, 1e308]}]},
    ],
)  # fmt: skip
def test_worlds_of_absurd_size_are_refused(flat_data, world):
    flat_data["world"] = world
    with pytest.raises(ScenarioError, match="is beyond"):
        parse_scenario(flat_data)


@pytest.mark.parametrize("number", [NAN, INF, -INF, 1e308])
@pytest.mark.parametrize(
    ("node", "key", "value"),
    [
        ("gap_following", "route", lambda x: [[10.0, x]]),
        ("gap_following", "height_m", lambda x: x),
        ("gap_following", "level_mount", lambda x: [x, 0.0, 0.0]),
        ("coverage", "crossing_height_m", lambda x: x),
        ("coverage", "height_m", lambda x: x),
        ("region_avoidance", "mount", lambda x: [0.0, x, 0.0]),
        ("depth_avoidance", "mount", lambda x: [0.0, x, 0.0]),
    ],
)
def test_parameters_of_nodes_are_finite(flat_data, node, key, value, number):
    entry = {"node": node, "parameters": {key: value(number)}}
    flat_data["types"]["f450"]["nodes"] = [entry]
    with pytest.raises(ScenarioError, match=key):
        Simulation(parse_scenario(flat_data), threads=1)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("crossing_height_m", -1.0, "crossing_height_m must be 0 to 10000 m"),
        ("height_m", 1e5, "height_m must be"),
        ("layer_spacing_m", -5.0, "layer_spacing_m must be"),
    ],
)
def test_coverage_has_heights_at_which_something_flies(flat_data, key, value, words):
    node = "coverage"
    flat_data["nodes"] = [{"node": node, "parameters": {key: value}}]
    with pytest.raises(ScenarioError, match=words):
        Simulation(parse_scenario(flat_data), threads=1)


@pytest.mark.parametrize("route", [[[1.0]], [[1.0, 2.0, 3.0]], ["x"], [1.0, 2.0], [[True, 1.0]]])
def test_a_route_is_of_points(flat_data, route):
    entry = {"node": "gap_following", "parameters": {"route": route}}
    flat_data["types"]["f450"]["nodes"] = [entry]
    with pytest.raises(ScenarioError, match=r"route must be a list of \[x, y\]"):
        Simulation(parse_scenario(flat_data), threads=1)


@pytest.mark.parametrize("value", [NAN, INF, 1e308, 10**400], ids=["nan", "inf", "far", "long"])
def test_parameters_set_in_flight_are_finite(simulate, wood_data, value):
    simulation = simulate(wood_data)
    height = simulation.graph.parameters.get("/uav1/gap_following", "height_m")
    with pytest.raises(GraphError, match="height_m"):
        height.set(value)
    assert height.value == 3.0


_BASELESS = """
from volery.graph.nodes.node import Node

class Silent(Node):
    def __init__(self, **options):
        pass

class Late(Node):
    def __init__(self, **options):
        self.create_timer(1.0, print)
        super().__init__("late", **options)
"""


@pytest.mark.parametrize("name", ["Silent", "Late"])
def test_a_node_without_super_init_gets_an_error_with_the_line_to_add(
    flat_data, tmp_path, monkeypatch, name
):
    (tmp_path / "baseless.py").write_text(_BASELESS)
    monkeypatch.syspath_prepend(str(tmp_path))
    flat_data["types"]["f450"]["nodes"] = [{"node": f"baseless:{name}"}]
    line = re.escape(f'super().__init__("{name.lower()}", **options)')
    with pytest.raises(ScenarioError, match=rf"{name}.__init__ does not call .*{line}"):
        Simulation(parse_scenario(flat_data), threads=1)


# ------------------------------------------------------------------------------- runs that diverge


@pytest.mark.parametrize("suffix", ["mcap", "bag"])
def test_log_and_report_of_a_flight_that_diverges_can_be_read(tmp_path, monkeypatch, suffix):
    """The check before the flight is taken away: the one in flight must do alone."""
    monkeypatch.setattr("volery.control.model_table.check_stability", lambda *_: None)
    path = changed(tmp_path, "vehicle/airframes/f450.toml", "drag_area_m2", "[99.0, 99.0, 99.0]")
    gust = "{amplitude_m_s = [60.0, 0.0, 0.0], start_s = 0.5, rise_s = 0.001}"
    (tmp_path / "s.toml").write_text(
        'name = "stiff"\nduration_s = 5.0\n'
        f"world = {{wind = {{gusts = [{gust}]}}}}\n"
        f'types = {{f = {{airframe = "{path.name}", sensors = [{{kind = "ground_truth"}}]}}}}\n'
        'uavs = [{type = "f", position_m = [0.0, 0.0, 50.0]}]\n'
    )
    log, report = tmp_path / f"log.{suffix}", tmp_path / "report"
    words = ["run", str(tmp_path / "s.toml"), "--record", str(log), "--report", str(report)]
    done = CliRunner().invoke(app, words)
    assert isinstance(done.exception, SystemExit), done.exception
    assert done.exit_code == 2
    assert "the state of uav1 is not physical at" in done.output
    assert "the likely cause is body.drag_area_m2 of airframe 'f450'" in done.output
    assert summarize(log).messages > 0
    assert (report / "index.html").is_file()


# ------------------------------------------------------------------------------------ command line


@pytest.mark.parametrize(
    "words",
    [
        "--speed nan",
        "--speed inf",
        "--speed 1e308",
        "--speed -1",
        "--seconds nan",
        "--seconds 1e300",
        "--seconds -1",
        "--seconds 1e-300",
        "--uavs -1",
        "--uavs 0",
        "--uavs 99999999999999999999",
        "--seed -1",
        "--seed 10000000000000000000000000",
        "--threads 0",
        "--threads 1000000000",
        "--autopilot-timeout inf",
        "--autopilot-timeout nan",
        "--autopilot-timeout 1e308",
    ],
)
def test_absurd_options_are_refused_in_a_line(words):
    done = CliRunner().invoke(app, ["run", "hover", *words.split()])
    assert isinstance(done.exception, SystemExit), done.exception
    assert done.exit_code == 2
    assert words.split()[0][2:] in done.output or "duration_s" in done.output


# --------------------------------------------------------------------------------------- rosbridge


@pytest.mark.parametrize("header", ["Host", "Origin", "Authorization"])
def test_a_header_given_twice_is_a_bad_request(simulate, flat_data, caplog, header):
    simulation = simulate(flat_data)
    with BridgeHost(simulation.gateway) as bridges:
        server = RosbridgeServer(port=0)
        bridges.open(server)
        request = (
            f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\nUpgrade: websocket\r\n"
            "Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
            f"{header}: a\r\n{header}: b\r\n\r\n"
        )
        with socket.create_connection(("127.0.0.1", server.port), timeout=60.0) as client:
            client.sendall(request.encode())
            response = client.recv(4096)
    assert response.startswith(b"HTTP/1.1 400 ")
    assert f"{header} is given more than once".encode() in response
    assert "Traceback" not in caplog.text


def test_shipped_scenarios_are_within_all_bounds():
    names = tuple(volery.scenario.library.names())
    assert names
    assert tuple(load_scenario(name).name for name in names) == names
