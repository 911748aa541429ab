"""Logs and scenarios of other people: they read below their own folder and among shipped data."""

from __future__ import annotations

import json
import signal
import sys
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.recorded_flight import RecordedScenario, read_flight
from volery.core.errors import DataFileError, GraphError, RecordingError, ScenarioError, VoleryError
from volery.graph import messages as m
from volery.runtime import Simulation
from volery.runtime.construction.worlds import geometry_of
from volery.runtime.replay.log_player import LogPlayer
from volery.runtime.replay.scenario_record import scenario_of
from volery.scenario.access import SHIPPED_DATA, ScenarioAccess
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.load import load_scenario, parse_scenario

SECRET = "swordfish"
GROUND = "0.0,1.0,2.0\n3.0,4.0,5.0\n6.0,7.0,8.0\n"
TYPES: dict[str, Any] = {"f450": {"sensors": [{"kind": "imu"}]}}
UAVS = [{"type": "f450", "position_m": [20.0, 20.0]}]


def grid(file: str) -> dict[str, Any]:
    return {"terrain": {"kind": "grid", "file": file, "spacing_m": 20.0}}


def content(world: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"name": "stranger", "world": world, "types": TYPES, "uavs": UAVS, **more}


def foreign_log(path: Path, data: dict[str, Any], folder: str | None = "/") -> Path:
    """A log that names a scenario, and a folder that is not its own."""
    origin = {"name": data["name"], "seed": 1, "version": "0", "folder": folder, "content": data}
    with closing(create_log(path)) as log:
        publish(log, "/volery/scenario", 0, m.String(json.dumps(origin)))
        publish(log, "/clock", 1_000_000_000, m.Clock(m.time_from_ns(1_000_000_000)))
    return path


def publish(log: Any, topic: str, time_ns: int, message: Any) -> None:
    kind = {"String": "std_msgs/msg/String", "Clock": "rosgraph_msgs/msg/Clock"}
    log.write(
        m.Published(topic, kind[type(message).__name__.rpartition("__")[2]], time_ns, message)
    )


@pytest.fixture
def secret(tmp_path: Path) -> Path:
    """A file that no log may read, with numbers that would make a world."""
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    (folder / "ground.csv").write_text(GROUND)
    (folder / "notes.txt").write_text(f"{SECRET}:x:0:0\nmore of it\n")
    return folder


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """The folder of the log."""
    folder = tmp_path / "logs"
    folder.mkdir()
    (folder / "ground.csv").write_text(GROUND)
    return folder


def names_outside(secret: Path, own: Path) -> list[str]:
    (own / "link.csv").symlink_to(secret / "ground.csv")
    (own / "linked").symlink_to(secret)
    return [
        "/etc/passwd",
        str(secret / "ground.csv"),
        "../elsewhere/ground.csv",
        "link.csv",
        "linked/ground.csv",
        str(own / "ground.csv"),
        f"{SHIPPED_DATA}/../../../../ground.csv",
        "\0",
        "x" * 5000,
        "..",
        "",
    ]


def test_a_log_reads_below_its_own_folder_only(secret: Path, own: Path) -> None:
    for name in names_outside(secret, own):
        log = foreign_log(own / "flight.mcap", content(grid(name)))
        with LogPlayer(log) as player, pytest.raises(DataFileError, match="may be read") as refused:
            _ = player.geometry
        assert SECRET not in str(refused.value)
        assert str(secret) not in str(refused.value).replace(name[:80], "")
        log.unlink()
    with LogPlayer(foreign_log(own / "good.mcap", content(grid("ground.csv")))) as player:
        assert player.geometry is not None
        assert player.geometry.terrain.bounds == (0.0, 0.0, 40.0, 40.0)


WORLDS: dict[str, Any] = {
    "city": {"city": {"file": "FILE"}},
    "grid_map": {
        "grid_map": {"maps": [{"file": "FILE"}], "cell_size_m": 2.0, "block_height_m": 5.0}
    },
    "mesh": {"meshes": [{"file": "FILE"}]},
    "inventory": {"forest": {"kind": "inventory", "file": "FILE", "species": "broadleaf"}},
    "terrain": grid("FILE"),
    "wind": {"wind": {"field": "FILE"}},
}
MODELS: dict[str, Any] = {
    "airframe": {"airframe": "FILE"},
    "identified": {"plant": "identified", "identified_model": "FILE"},
    **{
        kind: {"sensors": [{"kind": kind, "model": "FILE"}]}
        for kind in ("lidar", "camera", "imu", "sonar", "odometry", "gnss", "barometer")
    },
    "magnetometer": {"sensors": [{"kind": "magnetometer", "model": "FILE"}]},
}


def named(template: Any, file: str) -> Any:
    return json.loads(json.dumps(template).replace("FILE", file))


@pytest.mark.parametrize("kind", [*WORLDS, *MODELS, "messages"])
@pytest.mark.parametrize("how", ["absolute", "upwards", "link"])
def test_every_key_that_names_a_file_is_confined(
    kind: str, how: str, tmp_path: Path, secret: Path, own: Path
) -> None:
    suffix = {"mesh": "stl", "city": "geojson"}.get(kind, "toml" if kind in MODELS else "csv")
    target = secret / f"target.{suffix}"
    target.write_text(f"{SECRET} = 1\n")
    (own / f"link.{suffix}").symlink_to(target)
    file = {
        "absolute": str(target),
        "upwards": f"../elsewhere/target.{suffix}",
        "link": f"link.{suffix}",
    }[how]
    data = content(named(WORLDS.get(kind, {}), file))
    if kind in MODELS:
        data["types"] = {"f450": {**TYPES["f450"], **named(MODELS[kind], file)}}
    if kind == "messages":
        data["message_packages"] = [str(secret)]
    scenario = scenario_of(RecordedScenario("stranger", 1, "0", data), folder=own)
    with pytest.raises(VoleryError, match="may be read") as refused:
        Simulation(scenario, threads=1)
    assert SECRET not in str(refused.value)


@pytest.mark.parametrize("airframe", ["/DIR/mine", "../../../DIR/mine", "../airframes/f450"])
def test_the_name_of_a_shipped_model_is_no_path(airframe: str, own: Path, tmp_path: Path) -> None:
    """`NAME` becomes `NAME.toml` among the shipped models."""
    shipped = Path(__file__).parents[2] / "src" / "volery" / "vehicle" / "airframes" / "f450.toml"
    (tmp_path / "mine.toml").write_bytes(shipped.read_bytes())
    name = airframe.replace("/DIR", str(tmp_path))
    data = content({}, types={"f450": {"airframe": name}})
    with pytest.raises(VoleryError, match="no airframe"):
        Simulation(scenario_of(RecordedScenario("stranger", 1, "0", data), folder=own), threads=1)


def test_a_beam_table_lies_beside_its_model(own: Path, secret: Path) -> None:
    (secret / "beams.csv").write_text(f"{SECRET},b\n1,2\n")
    (own / "mine.toml").write_text(
        (Path(__file__).parents[2] / "src/volery/sensors/models/vlp_16.toml").read_text()
    )
    text = (own / "mine.toml").read_text()
    head, _, rest = text.partition("[scan]")
    tail = rest[rest.index("\n[") :] if "\n[" in rest else ""
    for file in (str(secret / "beams.csv"), "../elsewhere/beams.csv"):
        table = f'[scan]\nkind = "table"\nrate_hz = 10.0\nfile = "{file}"\n'
        (own / "mine.toml").write_text(head + table + tail)
        data = content({}, types={"f450": {"sensors": [{"kind": "lidar", "model": "mine.toml"}]}})
        with pytest.raises(VoleryError) as refused:
            Simulation(
                scenario_of(RecordedScenario("stranger", 1, "0", data), folder=own), threads=1
            )
        assert SECRET not in str(refused.value)
        assert "lies in the folder of its model" in str(refused.value)


def test_an_upload_reads_below_its_own_folder_only(tmp_path: Path, secret: Path) -> None:
    """Also one that is not as the server made it."""
    folder = tmp_path / "uploads" / "yard"
    folder.mkdir(parents=True)
    toml = """
        name = "yard"
        [world.terrain]
        kind = "grid"
        file = "{file}"
        spacing_m = 20.0
        [types.f450]
        [[uavs]]
        type = "f450"
        position_m = [1.0, 1.0]
    """
    catalog = ScenarioCatalog(tmp_path / "uploads")
    for file in (str(secret / "ground.csv"), "../../elsewhere/ground.csv"):
        (folder / "scenario.toml").write_text(toml.format(file=file))
        with pytest.raises(DataFileError, match="may be read"):
            geometry_of(catalog.load("yard"))
    (folder / "ground.csv").write_text(GROUND)
    (folder / "scenario.toml").write_text(toml.format(file="ground.csv"))
    assert geometry_of(catalog.load("yard")).terrain.bounds == (0.0, 0.0, 40.0, 40.0)


def test_ones_own_scenario_keeps_its_names(tmp_path: Path, secret: Path) -> None:
    for file in (str(secret / "ground.csv"), "../elsewhere/ground.csv"):
        data = content(grid(file))
        folder = tmp_path / "logs"
        folder.mkdir(exist_ok=True)
        scenario = parse_scenario(data, access=ScenarioAccess(folder))
        assert geometry_of(scenario).terrain.bounds == (0.0, 0.0, 40.0, 40.0)


def test_a_log_borrows_what_ones_own_scenario_names_itself(own: Path, secret: Path) -> None:
    file, other = str(secret / "ground.csv"), str(secret / "notes.txt")
    mine = parse_scenario(content(grid(file)), access=ScenarioAccess(own))
    same = scenario_of(RecordedScenario("stranger", 1, "0", content(grid(file))), mine)
    assert geometry_of(same).terrain.bounds == (0.0, 0.0, 40.0, 40.0)
    spoiled = scenario_of(RecordedScenario("stranger", 1, "0", content(grid(other))), mine)
    with pytest.raises(DataFileError, match="may be read"):
        geometry_of(spoiled)
    with pytest.raises(ScenarioError, match="not of 'stranger'"):
        scenario_of(RecordedScenario("another", 1, "0", content({}, name="another")), mine)


def test_a_log_of_an_upload_finds_its_files(tmp_path: Path) -> None:
    folder = tmp_path / "recordings" / "uploads" / "stranger"
    folder.mkdir(parents=True)
    (folder / "ground.csv").write_text(GROUND)
    data = content(grid("ground.csv"))
    (folder / "scenario.toml").write_text(
        'name = "stranger"\n[world.terrain]\nkind = "grid"\nfile = "ground.csv"\n'
        'spacing_m = 20.0\n[types.f450]\n[[uavs]]\ntype = "f450"\nposition_m = [20.0, 20.0]\n'
    )
    log = foreign_log(tmp_path / "recordings" / "flight.mcap", data)
    catalog = ScenarioCatalog(tmp_path / "recordings" / "uploads", tmp_path / "recordings")
    with LogPlayer(log, catalog=catalog) as player:
        assert player.geometry is not None


def test_a_log_does_not_reveal_where_files_lie(tmp_path: Path) -> None:
    """Logs are passed on; folders of one's own machine are private."""
    with Simulation(load_scenario("hover"), threads=1) as simulation:
        log = create_log(tmp_path / "flight.mcap")
        simulation.graph.subscribe_all(log.write)
        simulation.run(0.1)
        log.close()
    origin = read_flight(tmp_path / "flight.mcap").origin
    assert str(Path(__file__).parents[2]) not in origin.to_json()
    assert not hasattr(origin, "folder")


@pytest.mark.parametrize("text", ["[]", "{}", '{"seed": "' + SECRET + '"}', "[" * 100_000])
def test_a_broken_scenario_of_a_log_is_not_quoted(text: str) -> None:
    with pytest.raises(RecordingError) as refused:
        RecordedScenario.from_json(text)
    assert SECRET not in str(refused.value)
    assert len(str(refused.value)) < 200


@pytest.mark.parametrize("folder", ["/tmp/maps", "../maps", "linked"])
def test_nodes_of_a_log_write_below_the_working_folder_only(
    folder: str, own: Path, secret: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(own)
    (own / "linked").symlink_to(secret)
    node = "mapping"
    kind = {"sensors": [], "nodes": [{"node": node, "parameters": {"folder": folder}}]}
    data = content({}, types={"f450": kind})
    with pytest.raises(ScenarioError, match="only name folders below the working folder"):
        Simulation(scenario_of(RecordedScenario("stranger", 1, "0", data), folder=own), threads=1)


def test_clients_set_no_parameter_that_names_files() -> None:
    node = "mapping"
    data = content({}, types={"f450": {"sensors": [], "nodes": [{"node": node}]}})
    with Simulation(parse_scenario(data), threads=1) as simulation:
        parameters = simulation.graph.parameters
        for name in ("folder", "map_file"):
            with pytest.raises(GraphError, match="read-only"):
                parameters.get("/uav1/mapping", name).set("/etc")


# ------------------------------------------------------------------------------ the whole attack


@pytest.mark.slow
def test_an_operator_reads_no_file_of_the_server(tmp_path: Path, secret: Path) -> None:
    """An uploaded log whose scenario names /etc/passwd, and a table elsewhere, as its ground."""
    pytest.importorskip("roslibpy")
    sys.path.insert(0, str(Path(__file__).parents[1] / "e2e"))
    from test_serve import Ros, Server

    server = Server(
        "serve", "--port", 0, "--recordings-dir", tmp_path / "recordings", "--threads", 1
    )
    try:
        server.wait_for(state="flying")
        first_line = Path("/etc/passwd").read_text().splitlines()[0]
        for k, file in enumerate(("/etc/passwd", str(secret / "ground.csv"))):
            log = foreign_log(tmp_path / f"attack{k}.mcap", content(grid(file)))
            code, reply = server.fetch(f"/api/recordings?name=attack{k}.mcap", log.read_bytes())
            assert code == 201, reply
            with Ros(server) as ros:
                response = ros.call(
                    "/volery/play_recording",
                    "volery_interfaces/srv/PlayRecording",
                    name=json.loads(reply)["name"],
                )
                assert response["success"], response
            server.wait_until(
                lambda status, log=log: (
                    status["state"] == "flying"
                    and log.name in status["message"]
                    and "may be read" in status["message"]
                )
            )
            assert server.status["scenario"] == "hover"
            shown = json.dumps(server.status) + "\n".join(server.lines)
            assert first_line not in shown
            assert "root:" not in server.status["message"]
    finally:
        server.end(signal.SIGKILL)
