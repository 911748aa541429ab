"""The registry of bridges: shipped names, names that other packages add, and broken ones."""

import hashlib
import importlib
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from volery.bridges.bridge_factory import BridgeOptions, bridge_names, make_bridge
from volery.cli.app import app
from volery.core.entry_points import EntryPoints
from volery.core.errors import BridgeError

SHIPPED = {
    "rosbridge": "rosbridge ws://127.0.0.1:9090",
    "ros-tcp": "ROS-TCP 127.0.0.1:10000 (ros1)",
    "ros-tcp-2": "ROS-TCP 127.0.0.1:10000 (ros2)",
    "ros-tcp-connector": "ROS-TCP to 127.0.0.1:10000 (not connected)",
    "ros1": "ROS 1 node /volery",
    "ros2": "ROS 2 node /volery",
    "ros2-zenoh": "ROS 2 node /volery",
    "sensor-link": "sensor link 127.0.0.1:10100, images 10101",
    "comms": "stations at 127.0.0.1:10200",
    "mavlink": "MAVLink UDP 127.0.0.1:14540 and following, 14550",
    "mavlink-tcp": "MAVLink TCP 127.0.0.1:5760",
    "mavlink-serial": "MAVLink serial /dev/ttyACM0 at 57600 baud",
    "px4": "PX4 127.0.0.1:4560 and following",
    "px4-serial": "PX4 serial /dev/ttyACM0 at 921600 baud",
    "ardupilot": "ArduPilot UDP 127.0.0.1:9002, +10 for each further UAV",
}
"""Every shipped name, and what its bridge calls itself at its default address."""

OTHERS = '''
from volery.bridges.bridge_factory import Bridge, BridgeKind


class Beacon:
    """Publishes one text."""

    def __init__(self, address, options):
        self._address = address
        self.token = options.token

    @property
    def name(self):
        return f"beacon {self._address.host}:{self._address.port}"

    async def start(self, gateway):
        self._session = gateway.open(self.name)
        self._session.advertise("/beacon", "std_msgs/msg/String")

    async def stop(self):
        self._session.close()


KIND = BridgeKind(9999, Beacon)
LINE = BridgeKind(1200, Beacon, is_serial=True)
'''


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Installs a package with a module `beacon_bridge` and these entry points."""

    def install(points, name="beacon-pkg"):
        folder = tmp_path / name
        info = folder / f"{name.replace('-', '_')}-1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(points)
        (folder / "beacon_bridge.py").write_text(OTHERS)
        (folder / "beacon_broken.py").write_text("import no_such_module_of_beacon\n")
        monkeypatch.syspath_prepend(folder)
        importlib.invalidate_caches()

    yield install
    sys.modules.pop("beacon_bridge", None)


def group(**points):
    return "[volery.bridges]\n" + "".join(f"{n} = {v}\n" for n, v in points.items())


def text_of(name):
    return f"{name}=/dev/ttyACM0" if name.endswith("-serial") else name


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_bridge_can_be_made(name):
    assert make_bridge(text_of(name), BridgeOptions()).name == SHIPPED[name]


@pytest.mark.parametrize("name", ["px4", "px4-serial", "ardupilot"])
def test_options_reach_the_bridges_of_autopilots(name):
    options = BridgeOptions(
        autopilot_timeout_s=3.0, drop_on_timeout=True, reports_missing_autopilots=False
    )
    bridge = make_bridge(text_of(name), options)
    assert (bridge._timeout_policy, bridge._notice_s) == ((3.0, True), None)


@pytest.mark.parametrize("name", ["mavlink", "mavlink-tcp", "mavlink-serial"])
def test_the_key_reaches_mavlink(name, tmp_path):
    key = tmp_path / "key"
    key.write_text("a text\n")
    signed = make_bridge(text_of(name), BridgeOptions(mavlink_key=key))
    assert signed._key == hashlib.sha256(b"a text").digest()
    with pytest.raises(BridgeError, match="cannot be read as a key"):
        make_bridge(text_of(name), BridgeOptions(mavlink_key=tmp_path / "none"))


def test_pyproject_names_what_ships():
    root = Path(__file__).parents[3]
    project = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    assert set(project["entry-points"]["volery.bridges"]) == set(SHIPPED)
    assert set(bridge_names()) >= set(SHIPPED)


def test_names_load_nothing_heavy():
    code = (
        "import pkgutil, sys\n"
        "from volery.bridges.bridge_factory import EntryPoints, GROUP\n"
        "points = EntryPoints(GROUP)\n"
        f"for name in {list(SHIPPED)!r}: pkgutil.resolve_name(points.find(name))\n"
        "heavy = {'numba', 'numpy', 'rosbags', 'asyncio', 'starlette', 'pymavlink', 'pydantic'}\n"
        "print(sorted(heavy & sys.modules.keys()))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_an_unknown_name_brings_a_hint_and_the_list():
    with pytest.raises(BridgeError) as error:
        make_bridge("mavlnk=14550", BridgeOptions())
    message = str(error.value)
    assert message.startswith("no bridge 'mavlnk'; did you mean 'mavlink'? Bridges: ")
    assert all(name in message for name in SHIPPED)


def test_missing_metadata_is_named(monkeypatch):
    monkeypatch.setattr(EntryPoints, "_targets", {})
    with pytest.raises(BridgeError, match="install Volery again"):
        make_bridge("rosbridge", BridgeOptions())


def test_another_package_adds_a_bridge(package):
    package(group(beacon="beacon_bridge:KIND", line="beacon_bridge:LINE"))
    bridge = make_bridge("beacon=8000", BridgeOptions(token="secret"))
    assert (bridge.name, bridge.token) == ("beacon 127.0.0.1:8000", "secret")
    assert make_bridge("line=/dev/ttyUSB0:300", BridgeOptions()).name == "beacon /dev/ttyUSB0:300"


def test_the_command_line_opens_it(package):
    package(group(beacon="beacon_bridge:KIND"))
    words = ["run", "hover", "--seconds", "0.1", "--speed", "max", "--bridge", "beacon"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert "open    beacon 127.0.0.1:9999" in result.output


def test_shipped_names_cannot_be_overridden(package):
    package(group(rosbridge="beacon_bridge:KIND"))
    assert make_bridge("rosbridge", BridgeOptions()).name.startswith("rosbridge")


@pytest.mark.parametrize(
    ("target", "reason"),
    [
        ("beacon_broken:KIND", "cannot be imported: .*no_such_module_of_beacon"),
        ("no_such_beacon:KIND", "cannot be imported: .*no_such_beacon"),
        ("beacon_bridge:NO_KIND", "cannot be imported: .*NO_KIND"),
        ("beacon bridge!", "cannot be imported"),
        ("beacon_bridge:Beacon", "is a type, not a BridgeKind"),
    ],
)
def test_a_broken_bridge_is_reported_with_its_package(package, target, reason):
    package(group(beacon=target))
    with pytest.raises(BridgeError, match=f"bridge 'beacon' of package 'beacon-pkg': .*{reason}"):
        make_bridge("beacon", BridgeOptions())
    make_bridge("rosbridge", BridgeOptions())


@pytest.mark.parametrize(
    "damage", [b"[volery.bridges]\nbeacon\n", b"[volery.bridges]\n\xff = a:b\n"]
)
def test_damaged_metadata_of_a_package_does_not_break_others(package, tmp_path, caplog, damage):
    package("", "damaged-pkg")
    (info,) = (tmp_path / "damaged-pkg").glob("*.dist-info")
    (info / "entry_points.txt").write_bytes(b"[volery.bridges]\n" + damage)
    assert make_bridge("rosbridge", BridgeOptions()).name.startswith("rosbridge")
    assert "package damaged-pkg: its entry points cannot be read" in caplog.text
