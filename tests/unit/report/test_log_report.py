"""Reports of logs: trajectories, errors, trunks, and a real flight over the simulated one."""

from __future__ import annotations

import json
import re
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from volery.bridges.logs.log_writer import create_log
from volery.core import rotations
from volery.core.errors import VoleryError
from volery.graph import messages as m
from volery.graph.codecs.zero import zero_message
from volery.report.logged_flights import read_flight, read_trajectory
from volery.report.page import ReportError
from volery.report.trajectory_page import write_log_report

S = 1_000_000_000
TREES = np.array([[5.0, 3.0], [12.0, -3.0], [20.0, 4.0]])
OFF = np.array([0.3, -0.4, 0.0])
"""How far the estimate is off."""


def position_at(seconds: float) -> np.ndarray:
    return np.array([0.5 * seconds + np.sin(0.7 * seconds), 2.0 * np.sin(0.2 * seconds), 3.0])


def odometry(time_ns: int, position: np.ndarray) -> Any:
    message = zero_message("nav_msgs/msg/Odometry")
    message.header = m.header(time_ns, "map")
    message.pose.pose = m.Pose(m.Point(*position.tolist()), m.Quaternion(0.0, 0.0, 0.0, 1.0))
    return message


def scan_at(time_ns: int, position: np.ndarray) -> Any:
    """Trunks of 15 cm radius before a wall that is out of range."""
    scan = zero_message("sensor_msgs/msg/LaserScan")
    scan.header = m.header(time_ns, "laser")
    scan.angle_min, scan.angle_increment = np.radians(-135.0), np.radians(0.25)
    angles = scan.angle_min + scan.angle_increment * np.arange(1081)
    ranges = np.full(1081, np.inf, np.float32)
    for tree in TREES - position[:2]:
        along = tree @ [np.cos(angles), np.sin(angles)]
        aside = np.abs(tree @ [-np.sin(angles), np.cos(angles)])
        hit = (aside < 0.15) & (along > 0.0)
        ranges[hit] = along[hit] - np.sqrt(0.15**2 - aside[hit] ** 2)
    scan.ranges = ranges
    return scan


@pytest.fixture(name="log", scope="module")
def _log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A minute of uav1, whose estimate is half a metre off."""
    path = tmp_path_factory.mktemp("logs") / "flight.mcap"
    with closing(create_log(path)) as log:
        for k in range(0, 1200):
            time_ns = k * S // 20
            position = position_at(k / 20.0)
            write(log, "/uav1/ground_truth/odom", time_ns, odometry(time_ns, position))
            write(log, "/uav1/odom", time_ns, odometry(time_ns, position + OFF))
            if k % 10 == 0:
                scan = scan_at(time_ns, position)
                write(log, "/uav1/laser/horizontal/scan", time_ns, scan)
            write(log, "/uav1/other", time_ns, m.String("x"))
    return path


def write(log: Any, topic: str, time_ns: int, message: Any) -> None:
    log.write(m.Published(topic, m.type_name(type(message)), time_ns, message))


def test_trajectories_and_trunks_of_a_log(log: Path) -> None:
    (uav,) = read_flight(log).uavs
    assert uav.name == "uav1"
    assert uav.truth is not None
    assert uav.estimate is not None
    np.testing.assert_allclose(uav.estimate.position - uav.truth.position, np.tile(OFF, (1200, 1)))
    away = np.linalg.norm(uav.trunks[None, :, :2] - (TREES + OFF[:2])[:, None], axis=2)
    assert len(uav.trunks) == 3
    assert not uav.is_founded
    assert away.min(axis=1).max() < 0.08


def test_the_page_shows_the_error(log: Path, tmp_path: Path) -> None:
    page = write_log_report(log, tmp_path / "new").path.read_text(encoding="utf-8")
    assert "error 0.50 m without, 0.00 m after" in page
    assert page.count("<svg") == 3
    assert "3 trunks detected by the level LIDAR" in page
    assert "Without a nodding LIDAR" in page
    assert '<p class="lead">60.0 s with 1 UAV.</p>' in page.replace("59.9", "60.0")


def test_an_older_report_is_replaced_only_if_asked(log: Path, tmp_path: Path) -> None:
    """Such as that of the run itself, which stands under the same name."""
    (tmp_path / "index.html").write_text("the run's own")
    with pytest.raises(ReportError, match=r"index\.html exists; --overwrite replaces it"):
        write_log_report(log, tmp_path)
    assert (tmp_path / "index.html").read_text() == "the run's own"
    assert "<svg" in write_log_report(log, tmp_path, overwrite=True).path.read_text()


def test_a_uav_that_is_not_there_is_reported(log: Path, tmp_path: Path) -> None:
    with pytest.raises(VoleryError, match="no UAV uav9; known: uav1"):
        write_log_report(log, tmp_path / "none", uav="uav9")
    assert not (tmp_path / "none").exists()


def test_the_scenario_is_named(log: Path, tmp_path: Path) -> None:
    origin, path = {"name": "glade", "content": {"name": "glade"}}, tmp_path / "flight.mcap"
    with closing(create_log(path)) as out:
        write(out, "/volery/scenario", 0, m.String(json.dumps(origin)))
        write(out, "/uav1/odom", 0, odometry(0, position_at(0.0)))
        write(out, "/uav2/odom", 4 * S, odometry(4 * S, position_at(4.0)))
    page = write_log_report(path, tmp_path / "out").path.read_text()
    assert '<p class="lead">Scenario glade, 4.0 s with 2 UAVs.</p>' in page
    one = write_log_report(path, tmp_path / "one", uav="uav2").path.read_text()
    assert "<h2>uav2</h2>" in one
    assert "<h2>uav1</h2>" not in one


def log_with_scenario(path: Path, content: dict[str, Any], trees: Path | None = None) -> Path:
    """The same minute, of a scenario that the log holds."""
    origin = {"name": "glade", "seed": 1, "version": "0", "folder": trees and str(trees)}
    with closing(create_log(path)) as out:
        write(out, "/volery/scenario", 0, m.String(json.dumps(origin | {"content": content})))
        for k in range(0, 1200):
            time_ns = k * S // 20
            write(out, "/uav1/odom", time_ns, odometry(time_ns, position_at(k / 20.0)))
            if k % 10 == 0:
                scan = scan_at(time_ns, position_at(k / 20.0))
                write(out, "/uav1/laser/horizontal/scan", time_ns, scan)
    return path


def test_the_true_trunks_are_drawn_beside_the_mapped_ones(tmp_path: Path) -> None:
    rows = [f"{x},{y},30\n" for x, y in (*TREES, (5.0, 100.0))]
    (tmp_path / "trees.csv").write_text("x_m,y_m,dbh_cm\n" + "".join(rows))
    content: dict[str, Any] = {
        "name": "glade",
        "types": {"f450": {"airframe": "f450"}},
        "uavs": [{"type": "f450", "position_m": [0.0, 0.0]}],
        "world": {
            "terrain": {"kind": "flat", "extent_m": 400.0},
            "forest": {"kind": "inventory", "file": "trees.csv", "species": "snag"},
        },
    }
    log = log_with_scenario(tmp_path / "flight.mcap", content, tmp_path)
    page = write_log_report(log, tmp_path / "out").path.read_text()
    assert "Rings: 3 trees of the scenario within 15 m" in page
    assert "100% of the mapped trunks are within 0.5 m of one" in page
    assert ">true trunks<" in page
    (tmp_path / "trees.csv").unlink()
    page = write_log_report(log, tmp_path / "later").path.read_text()
    assert "The scenario&#x27;s trees cannot be generated again: " in page
    assert ">true trunks<" not in page
    del content["world"]["forest"]
    bare = log_with_scenario(tmp_path / "bare.mcap", content)
    page = write_log_report(bare, tmp_path / "bare").path.read_text()
    assert "The scenario has no trees." in page


def test_a_log_without_scenario_shows_no_true_trunks(log: Path, tmp_path: Path) -> None:
    page = write_log_report(log, tmp_path / "out").path.read_text()
    assert "The log holds no scenario" in page
    assert ">true trunks<" not in page


def test_logs_that_are_cut_are_reported(log: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log.read_bytes()[: log.stat().st_size * 9 // 10])
    why = "cut.mcap: cut off in the middle of a chunk"
    for written in (
        write_log_report(cut, tmp_path / "one"),
        write_log_report(log, tmp_path / "other", compare=cut, compare_topic="/uav1/odom"),
    ):
        assert sum(why in text for text in written.warnings) == 1
        assert f'<p class="note">{why}, which begins at byte ' in written.path.read_text()
    cut.write_bytes(log.read_bytes()[:100])
    with pytest.raises(VoleryError, match=r"the log holds no UAV's poses.*the file is cut off"):
        write_log_report(cut, tmp_path / "none")


def test_a_topic_to_compare_needs_a_log(log: Path, tmp_path: Path) -> None:
    with pytest.raises(ReportError, match="--compare-topic /odom: name its log"):
        write_log_report(log, tmp_path / "none", compare_topic="/odom")


def test_a_similar_flight_is_reported(log: Path, tmp_path: Path) -> None:
    """As another UAV flies on a mission that begins alike."""
    real = tmp_path / "real.mcap"
    with closing(create_log(real)) as out:
        for k in range(1200):
            t, time_ns = k / 20.0, k * S // 20
            position = position_at(t) + np.array([0.0, 0.35 * np.sin(1.1 * t), 0.0])
            write(out, "/odom", time_ns, odometry(time_ns, position))
    written = write_log_report(log, tmp_path / "out", compare=real)
    (alike,) = re.findall(r"correlation of speeds (\S+),", written.fit)
    assert 0.8 < float(alike) < 0.95
    assert any("the speeds differ" in text for text in written.warnings)


def test_times_of_day_are_shown_as_such(log: Path, tmp_path: Path) -> None:
    """Of a real log over a simulated one, and over itself."""
    real, begin_s = tmp_path / "real.mcap", 1_700_000_000
    with closing(create_log(real)) as out:
        for k in range(1000):
            time_ns = begin_s * S + k * S // 20
            write(out, "/uav1/odom", time_ns, odometry(time_ns, position_at((k + 100) / 20.0)))
    page = write_log_report(log, tmp_path / "one", compare=real).path.read_text()
    assert "so that 2023-11-14 22:13:20 UTC, its beginning, is 5.00 s" in page
    page = write_log_report(real, tmp_path / "other").path.read_text()
    assert page.count("time since 2023-11-14 22:13:20 UTC, s") == 2
    assert "1.7" not in "".join(re.findall(r">([^<>]*)</text>", page))


def test_a_goal_is_no_position(tmp_path: Path) -> None:
    path = tmp_path / "real.mcap"
    with closing(create_log(path)) as out:
        for topic in ("/mavros/local_position/pose", "/mavros/setpoint_position/local", "/goal"):
            pose = zero_message("geometry_msgs/msg/PoseStamped")
            pose.header = m.header(S, "map")
            out.write(m.Published(topic, "geometry_msgs/msg/PoseStamped", S, pose))
        write(out, "/chat", S, m.String("x"))
    assert len(read_trajectory(path).trajectory.time_s) == 1
    offered = r"Topics with poses: /mavros/local_position/pose$"
    with pytest.raises(VoleryError, match=r"/chat holds no poses: it is a std_msgs/msg/String\. "):
        read_trajectory(path, "/chat")
    with pytest.raises(VoleryError, match=offered):
        read_trajectory(path, "/none")
    assert len(read_trajectory(path, "/goal").trajectory.time_s) == 1  # on request it is read


def test_a_flight_that_is_another_one_is_reported(log: Path, tmp_path: Path) -> None:
    real, random = tmp_path / "real.mcap", np.random.default_rng(3)
    trajectory = np.cumsum(random.normal(0.0, 0.3, (600, 3)), axis=0)
    with closing(create_log(real)) as out:
        for k, position in enumerate(trajectory):
            write(out, "/odom", (k + 1) * S // 20, odometry((k + 1) * S // 20, position))
    written = write_log_report(log, tmp_path / "out", compare=real)
    assert any("it may be another flight" in text for text in written.warnings)
    assert '<p class="note">real.mcap: it may be another flight' in written.path.read_text()


def test_a_flight_laid_over_itself_is_moved_by_nothing(log: Path, tmp_path: Path) -> None:
    written = write_log_report(log, tmp_path / "out", compare=log)
    assert written.warnings == []
    assert "its clock moved by 0.00 s" in written.path.read_text()


def test_a_real_flight_is_laid_over_it(log: Path, tmp_path: Path) -> None:
    """The same trajectory, elsewhere, turned, at another hour, with noise of 0.1 m."""
    real, turn = tmp_path / "real.bag", rotations.matrix(rotations.from_rpy(0.0, 0.0, 1.1))
    noise = np.random.default_rng(2).normal(0.0, 0.1, (1000, 3))
    with closing(create_log(real)) as out:
        for k in range(1000):
            time_ns = (k + 5000) * S // 20
            position = (position_at((k + 100) / 20.0) + noise[k]) @ turn.T + [40.0, 7.0, 1.0]
            write(out, "/mavros/odom", time_ns, odometry(time_ns, position))
    written = write_log_report(log, tmp_path / "out", compare=real)
    assert written.warnings == []
    page = written.path.read_text(encoding="utf-8")
    (moved,) = re.findall(r"its clock moved by (\S+) s", page)
    assert float(moved) == pytest.approx(-245.0, abs=0.11)
    (left,) = re.findall(r"Root mean square distance (\S+) m", page)
    assert float(left) == pytest.approx(0.1 * 3**0.5, abs=0.05)
    assert page.count("<svg") == 6
    with pytest.raises(VoleryError, match="no UAV uav7; known: uav1"):
        write_log_report(log, tmp_path, compare=real, uav="uav7")
    with pytest.raises(VoleryError, match=r"there is no /odom\. Topics with poses: /mavros/odom"):
        read_trajectory(real, "/odom")


def test_a_clock_that_was_set_in_flight_is_reported(log: Path, tmp_path: Path) -> None:
    """As that of a computer without a battery for it, until it receives the time."""
    real = tmp_path / "real.bag"
    with closing(create_log(real)) as out:
        for k in range(1000):
            time_ns = k * S // 20 + (k > 500) * 1_700_000_000 * S
            write(out, "/mavros/odom", time_ns, odometry(time_ns, position_at(k / 20.0)))
    with pytest.raises(VoleryError, match="span 472222 hours; was its clock set"):
        write_log_report(log, tmp_path / "out", compare=real)


def test_a_log_without_uavs(tmp_path: Path) -> None:
    path = tmp_path / "empty.mcap"
    with closing(create_log(path)) as log:
        write(log, "/talk", 0, m.String("x"))
    with pytest.raises(VoleryError, match="the log holds no UAV's poses"):
        read_flight(path)
    with pytest.raises(VoleryError, match="Topics with poses: none"):
        read_trajectory(path)


def test_poses_that_are_no_numbers_are_left_out(tmp_path: Path) -> None:
    """As filters report that have diverged."""
    path = tmp_path / "lost.mcap"
    with closing(create_log(path)) as log:
        for k in range(20):
            pose = zero_message("geometry_msgs/msg/PoseStamped")
            pose.header = m.header((k + 1) * 100_000_000, "map")
            pose.pose.position.x = float("nan") if k % 4 == 3 else float(k)
            time_ns = (k + 1) * 100_000_000
            log.write(m.Published("/pose", "geometry_msgs/msg/PoseStamped", time_ns, pose))
    trajectory = read_trajectory(path).trajectory
    assert len(trajectory.time_s) == 15
    assert np.isfinite(trajectory.position).all()


def test_what_slam_publishes_is_the_estimate(tmp_path: Path) -> None:
    """Where it is recorded, in the place of the odometry."""
    path = tmp_path / "flight.mcap"
    with closing(create_log(path)) as log:
        for k in range(100):
            time_ns, position = (k + 1) * S // 10, position_at(k / 10.0)
            write(log, "/uav1/ground_truth/odom", time_ns, odometry(time_ns, position))
            write(
                log, "/uav1/odom", time_ns, odometry(time_ns, position + np.array([5.0, 0.0, 0.0]))
            )
            pose = zero_message("geometry_msgs/msg/PoseWithCovarianceStamped")
            pose.header = m.header(time_ns, "map")
            pose.pose.pose = odometry(time_ns, position + OFF).pose.pose
            write(log, "/uav1/slam/pose", time_ns, pose)
    (uav,) = read_flight(path).uavs
    assert uav.estimate is not None
    assert uav.truth is not None
    np.testing.assert_allclose(uav.estimate.position - uav.truth.position, np.tile(OFF, (100, 1)))
