"""`volery slam`: logs of every kind in, map and path out."""

import json

import numpy as np
import pytest
from PIL import Image
from planar_bench import Carried, storey
from typer.testing import CliRunner

from volery.autonomy.perception.static_transforms import LEVEL
from volery.cli.app import app
from volery.cli.slam import _advise
from volery.runtime.replay.slam.offline_slam import OfflineSlam, SlamResult
from volery.runtime.replay.slam.topic_selection import TopicSelection
from volery.runtime.replay.slam.trajectory import EstimatedTrajectory

CORNERS = [(0.0, 0.0), (16.0, 0.0)]
FILES = ("map.pgm", "map.png", "map.yaml", "path.tum", "summary.json")


@pytest.fixture(scope="module")
def carried():
    return Carried(storey(), CORNERS, beams=241, fov_deg=240.0, max_range_m=8.0)


@pytest.fixture(scope="module")
def text(carried, tmp_path_factory):
    """A log with a line cut off at its end, and its layout beside it."""
    folder = tmp_path_factory.mktemp("log")
    lines = list(carried.text())
    (folder / "scans.txt").write_text("\n".join([*lines, lines[-1][:200]]))
    (folder / "layout.toml").write_text(carried.layout())
    return folder


def slam(*arguments):
    return CliRunner().invoke(app, ["slam", *map(str, arguments)])


@pytest.fixture(scope="module")
def mapped(text):
    result = slam(text / "scans.txt", "--layout", text / "layout.toml", "--out", text / "out")
    assert result.exit_code == 0, result.output
    return text / "out", result.output


def grid_of(folder):
    """Shades (rows, columns), the lowest row first, origin and width of cells."""
    metadata = dict(line.split(": ", 1) for line in (folder / "map.yaml").read_text().splitlines())
    assert metadata["mode"] == "trinary"
    with Image.open(folder / metadata["image"]) as image:
        shades = np.asarray(image)[::-1]
    return shades, np.array(json.loads(metadata["origin"]))[:2], float(metadata["resolution"])


def tum_of(folder):
    return np.loadtxt(folder / "path.tum")


def distance_to_walls(points, walls):
    a, d = walls[:, :2], walls[:, 2:] - walls[:, :2]
    rel = points[:, None] - a
    share = np.clip((rel * d).sum(-1) / (d * d).sum(-1), 0.0, 1.0)
    return np.hypot(*np.moveaxis(rel - share[..., None] * d, -1, 0)).min(axis=1)


def test_a_text_log_becomes_map_path_and_summary(mapped, carried):
    folder, said = mapped
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["mode"] == "planar"
    assert summary["scans"] == len(carried.time_s)
    assert summary["refused"] == 1
    assert summary["way_m"] == pytest.approx(16.0, abs=0.3)
    assert "mapping " in said
    assert "m path length (without IMU)" in said
    assert f"1 line left out; line {len(carried.time_s) + 1}: " in said
    assert "warning: " in said
    assert said.count("warning: ") == 1
    assert "error: " not in said
    path = tum_of(folder)
    assert path.shape == (len(carried.time_s), 8)
    np.testing.assert_allclose(path[:, 0], carried.time_s, atol=1e-6)
    np.testing.assert_allclose(path[:, 1:3], carried.poses[:, :2], atol=0.1)
    np.testing.assert_allclose(np.linalg.norm(path[:, 4:], axis=1), 1.0, atol=1e-5)


def test_the_map_is_that_of_the_walls(mapped, carried):
    shades, origin, cell = grid_of(mapped[0])
    assert set(np.unique(shades)) == {0, 205, 254}
    rows, columns = np.nonzero(shades == 0)
    occupied = origin + (np.stack([columns, rows], 1) + 0.5) * cell
    assert len(occupied) > 500
    away = distance_to_walls(occupied, carried.walls)
    assert np.quantile(away, 0.95) < 0.08
    free = shades == 254
    i, j = ((carried.poses[:, :2] - origin) / cell).astype(int).T
    assert free[j, i].mean() > 0.9
    with Image.open(mapped[0] / "map.png") as image:
        assert min(image.size) > 100


def test_files_are_replaced_only_if_asked(mapped, text):
    command = (text / "scans.txt", "--layout", text / "layout.toml", "--out", mapped[0])
    refused = slam(*command)
    assert refused.exit_code == 2
    assert "--overwrite" in refused.output
    assert slam(*command, "--overwrite").exit_code == 0


@pytest.mark.parametrize("kind", ["scans.mcap", "scans.bag", "ros2"])
def test_logs_of_other_kinds_give_the_same_path(kind, mapped, text, tmp_path):
    log = tmp_path / ("scans.mcap" if kind == "ros2" else kind)
    layout = ["--layout", str(text / "layout.toml")]
    made = CliRunner().invoke(app, ["convert", str(text / "scans.txt"), str(log), *layout])
    assert made.exit_code == 0, made.output
    if kind == "ros2":
        log = as_ros2_bag(log, tmp_path / "bag")
    result = slam(log, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    np.testing.assert_allclose(tum_of(tmp_path / "out"), tum_of(mapped[0]), atol=1e-6)


def as_ros2_bag(log, folder):
    """The same messages in a ROS 2 bag, as SQLite."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    from volery.bridges.logs.records import LogWalk

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(folder, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        made = {}
        for record in LogWalk(log):
            name = record.topic.topic
            if name not in made:
                made[name] = writer.add_connection(name, record.topic.msgtype, typestore=store)
            writer.write(made[name], record.time_ns, record.data)
    return folder


def test_odometry_and_closures_can_be_left_out(text, tmp_path):
    layout = ("--layout", text / "layout.toml")
    more = (
        "--no-odometry",
        "--no-loop-closure",
        "--initial-pose",
        "10,5,0,90",
        "--resolution",
        "0.1",
    )
    result = slam(text / "scans.txt", *layout, "--out", tmp_path / "out", *more)
    assert result.exit_code == 0, result.output
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert "/uav1/odom" not in summary["topics"]
    first, last = tum_of(tmp_path / "out")[[0, -1]]
    np.testing.assert_allclose(first[1:4], [10.0, 5.0, 0.0], atol=0.05)
    np.testing.assert_allclose(last[1:3], [10.0, 21.0], atol=0.4)
    assert grid_of(tmp_path / "out")[2] == 0.1


def test_a_folder_that_cannot_be_written_to_is_an_error_before_the_work(text, monkeypatch):
    def work(*_):
        raise AssertionError("it maps already")

    monkeypatch.setattr(OfflineSlam, "run", work)
    layout = ("--layout", text / "layout.toml")
    result = slam(text / "scans.txt", *layout, "--out", "/proc/nowhere/out")
    assert result.exit_code == 2
    assert "error: /proc/nowhere/out: cannot write the map there: " in result.output
    result = slam(text / "scans.txt", *layout, "--out", text / "scans.txt")
    assert result.exit_code == 2
    assert "is not a folder" in result.output


@pytest.mark.parametrize("max_cells", [40_000, 40])
def test_a_map_that_is_too_large_costs_nothing_else(max_cells, text, tmp_path, monkeypatch):
    """Its cells become coarser, and where that does not help the path is written all the same."""
    monkeypatch.setattr("volery.runtime.replay.slam.map_rendering._MAX_CELLS", max_cells)
    out = tmp_path / "out"
    result = slam(text / "scans.txt", "--layout", text / "layout.toml", "--out", out)
    assert result.exit_code == 0, result.output
    summary = json.loads((out / "summary.json").read_text())
    assert len(tum_of(out)) == summary["scans"]
    if max_cells == 40:
        assert "warning: no map is written: " in result.output
        assert summary["cell_m"] is None
        assert sorted(path.name for path in out.iterdir()) == ["path.tum", "summary.json"]
    else:
        assert f"cells are {summary['cell_m']:g} m wide" in result.output
        assert summary["cell_m"] in (0.1, 0.2, 0.4)
        assert grid_of(out)[2] == summary["cell_m"]


def test_a_uav_that_is_not_in_the_log_is_an_error(text, tmp_path):
    command = (text / "scans.txt", "--layout", text / "layout.toml", "--out", tmp_path / "out")
    result = slam(*command, "--uav", "uav9")
    assert result.exit_code == 2
    assert "there is no uav9 in it; there is uav1" in result.output


def test_an_imu_that_was_not_used_is_advised_where_the_plane_does_not_do(capsys):
    channels = TopicSelection("uav1", {}, has_imu=False)
    empty = np.zeros(0, np.int64)
    trajectory = EstimatedTrajectory(empty, empty, np.zeros((0, 3)), np.zeros((0, 4)))
    outcome = SlamResult(channels, trajectory, [], lambda _: LEVEL, 9, 9.0, 0.1, {})
    topics = {"/uav1/imu": "sensor_msgs/msg/Imu"}
    outcome.states.update(tracking=6.0, degraded=3.0)
    _advise(outcome, {})
    assert capsys.readouterr().err == ""
    _advise(outcome, topics)
    warning = capsys.readouterr().err
    assert warning.startswith("warning: degraded or lost for 33% of the time, in the plane")
    assert "(/uav1/imu) may help: --imu" in warning
    outcome.states.update(tracking=60.0)
    _advise(outcome, topics)
    assert capsys.readouterr().err == ""


def test_a_clock_set_back_in_the_middle_costs_no_scan(text, carried, tmp_path):
    lines = list(carried.text())
    later = [f"{float(line.split(' ', 1)[0]) - 9e6:.0f} {line.split(' ', 1)[1]}" for line in lines]
    path = tmp_path / "scans.txt"
    path.write_text("\n".join([*lines[:60], *later[60:]]))
    result = slam(path, "--layout", text / "layout.toml", "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["scans"], summary["clock_set"], summary["refused"]) == (len(lines), 1, 0)
    assert tum_of(tmp_path / "out")[-1, 1] == pytest.approx(16.0, abs=0.3)


@pytest.mark.parametrize(
    ("content", "arguments", "message"),
    [
        ("", ("--layout", "layout.toml"), "has no scan of this layout"),
        ("", (), "the file is empty"),
        ("1 2 3\n", (), "a scanner's text log needs --layout"),
        ("1 2 3\n", ("--layout", "layout.toml"), "3 columns where the layout needs"),
        ("1 2 3\n", ("--layout", "none.toml"), "none.toml: cannot be read"),
        (
            "1 2 3\n",
            ("--layout", "layout.toml", "--initial-pose", "1,2"),
            "--initial-pose: expects 4 numbers",
        ),
        (
            "1 2 3\n",
            ("--layout", "layout.toml", "--scan-topic", "/scan"),
            "there is no sensor_msgs",
        ),
        ("1 2 3\n", ("--layout", "layout.toml", "--imu"), "which sensor_msgs/msg/Imu is meant"),
        (None, (), "cannot read the log"),
    ],
)
def test_what_cannot_be_mapped_is_reported_in_a_line(content, arguments, message, text, tmp_path):
    path = tmp_path / "scans.txt"
    if content is not None:
        path.write_text(content)
    (tmp_path / "layout.toml").write_text((text / "layout.toml").read_text())
    arguments = [str(tmp_path / a) if a.endswith(".toml") else a for a in arguments]
    result = slam(path, "--out", tmp_path / "out", *arguments)
    assert result.exit_code == 2
    assert message in result.output
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("line", "instead", "message"),
    [
        ("[odometry]", "[odometry]\nunit_m = 1.0", "warning: the path is 16"),
        ("beams = 241", "beams = 200", "41 columns unused: a line has 245, the layout's last"),
        (
            "[ranges]",
            "[ranges]\nunit_m = 1.0",
            "range lies between 0.02 and 8 m: is ranges.unit_m = 1 right?",
        ),
    ],
)
def test_a_layout_that_hardly_fits_is_reported(line, instead, message, text, tmp_path):
    layout = (text / "layout.toml").read_text()
    assert line in layout
    (tmp_path / "layout.toml").write_text(layout.replace(line, instead))
    command = (text / "scans.txt", "--layout", tmp_path / "layout.toml", "--out", tmp_path / "o")
    said = slam(*command).output
    assert said.count("warning: ") == 2  # the other one is of the line that is cut off
    assert message in said


def test_a_log_without_anything_in_range_says_why(text, carried, tmp_path):
    path = tmp_path / "scans.txt"
    blind = " ".join(["0"] * len(carried.angles))
    path.write_text("\n".join(f"{k * 200_000} 0 0 0 {blind}" for k in range(20)))
    result = slam(path, "--layout", text / "layout.toml", "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert "the SLAM did not start (too few returns in range)" in result.output
