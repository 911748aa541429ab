"""`volery slam` on a log: it finds the mounts of the LIDARs and the initial pose, or asks."""

import json
import math
import re
from contextlib import closing

import numpy as np
import pytest
from node_bench import NodeBench
from slam_bench import LEVEL, NODDING, Flight, S, messages, nod_angle, trunks
from typer.testing import CliRunner

from volery.autonomy.slam.slam_node import Slam
from volery.bridges.logs.log_writer import create_log
from volery.cli.app import app
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import (
    Published,
    Quaternion,
    String,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    header,
    stamp_of,
)
from volery.runtime.replay.slam.initial_pose import beginning_of
from volery.runtime.replay.slam.sources import open_source

SECONDS = 6.0
STANDS_M = 0.12
"""Height of the body of an F450 on its feet."""
LEVEL_FRAME, NODDING_FRAME = "uav1/laser_horizontal", "uav1/laser_nodding"
SENSORS = [
    {"kind": "lidar", "name": name, "model": "utm_30lx", "position_m": position.tolist()}
    for name, position in (("horizontal", LEVEL), ("nodding", NODDING))
]
CONTENT = {
    "name": "woods",
    "duration_s": 9.0,
    "types": {"surveyor": {"sensors": SENSORS}},
    "uavs": [{"type": "surveyor", "position_m": [40.0, -30.0], "yaw_deg": 90.0}],
}
ORIGIN = {"name": "woods", "seed": 1, "version": "0", "folder": None, "content": CONTENT}


def joint(time_ns, parent, child, position, nod=0.0):
    turn = Quaternion(0.0, math.sin(0.5 * nod), 0.0, math.cos(0.5 * nod))
    moved = Transform(Vector3(*map(float, position)), turn)
    return TransformStamped(header(time_ns, parent), child, moved)


def own_motion(time_ns):
    """A joint of `/tf` that is none of a scanner."""
    return joint(time_ns, "uav1/odom", "uav1/base_link", (50.0, 20.0, 3.0))


class Flown:
    """A recorded flight, what its own SLAM published, and the messages that contain the mounts."""

    def __init__(self):
        self.flight_messages = messages(Flight(), trunks(), SECONDS)
        for _, topic, message in self.flight_messages:
            if topic.startswith("laser"):
                is_level = "horizontal" in topic
                message.header.frame_id = LEVEL_FRAME if is_level else NODDING_FRAME
        bench = NodeBench()
        mounts = {"level_mount": LEVEL.tolist(), "nodding_mount": NODDING.tolist()}
        bench.start(Slam, **mounts)
        published = bench.listen("/uav1/slam/odom")
        for when, topic, message in self.flight_messages:
            bench.run_to(max(when, bench.now_ns))
            bench.send(f"/uav1/{topic}", message)
        positions = [m.pose.pose.position for m in published]
        self.own = np.array(
            [(stamp_of(m) / S, p.x, p.y, p.z) for m, p in zip(published, positions, strict=True)]
        )

    def write(self, path, *, holder, others=(), truth=None, later_s=0.0):
        """A log in which `/tf_static`, `/tf`, the scenario or nothing holds the nodding mount."""
        with closing(create_log(path)) as log:

            def put(topic, when, message):
                log.write(Published(topic, message.__msgtype__, when, message))

            if holder == "scenario":
                put("/volery/scenario", 0, String(json.dumps(ORIGIN)))
            if truth is not None:
                put("/uav1/ground_truth/odom", 0, truth)
            fixed = [joint(0, "uav1/base_link", LEVEL_FRAME, LEVEL)]
            if holder == "static":
                half = 0.5 * NODDING
                fixed.append(joint(0, "uav1/base_link", "uav1/bracket", half))
                fixed.append(joint(0, "uav1/bracket", NODDING_FRAME, half))
            if holder == "bracket":
                fixed.append(joint(0, "uav1/bracket", NODDING_FRAME, (0.0, 0.0, 0.0)))
            put("/tf_static", 0, TFMessage(fixed))
            for name in others:
                put(f"/{name}/laser/horizontal/scan", 0, self.flight_messages[-1][2])
            for when, topic, message in self.flight_messages:
                if topic == "joint_states":
                    moving = [own_motion(when)]
                    child = {"moving": NODDING_FRAME, "bracket": "uav1/bracket"}.get(holder)
                    if child is not None:
                        nod = nod_angle(when / S)[0]
                        moving.append(joint(when, "uav1/base_link", child, NODDING, nod))
                    put("/tf", when, TFMessage(moving))
                put(f"/uav1/{topic}", when + round(later_s * S), message)


@pytest.fixture(scope="module")
def flown():
    return Flown()


def slam(log, out, *more):
    return CliRunner().invoke(app, ["slam", str(log), "--out", str(out), *more])


@pytest.mark.parametrize("holder", ["static", "moving", "bracket", "scenario"])
def test_a_log_gives_the_trajectory_that_its_own_slam_published(holder, flown, tmp_path):
    flown.write(tmp_path / "flight.mcap", holder=holder)
    result = slam(tmp_path / "flight.mcap", tmp_path / "out", "--initial-pose", "0,0,0,0")
    assert result.exit_code == 0, result.output
    assert "--initial-pose overrides it" not in result.output
    path = np.loadtxt(tmp_path / "out" / "path.tum")
    own = np.stack([np.interp(path[:, 0], flown.own[:, 0], flown.own[:, k]) for k in (1, 2, 3)], 1)
    assert len(path) > 200
    assert np.abs(own[-1] - own[0]).max() > 1.0
    np.testing.assert_allclose(path[:, 1:4], own, atol=0.015)


def truth(frame="map"):
    """At 7, 8, 9 m, nose to the north."""
    message = zero_message("nav_msgs/msg/Odometry")
    p, q, message.header.frame_id = message.pose.pose.position, message.pose.pose.orientation, frame
    p.x, p.y, p.z, q.z, q.w = 7.0, 8.0, 9.0, math.sqrt(0.5), math.sqrt(0.5)
    return message


@pytest.mark.parametrize(
    ("more", "begins"),
    [
        ({}, (40.0, -30.0, STANDS_M, 90.0)),
        ({"truth": truth()}, (7.0, 8.0, 9.0, 90.0)),
        ({"truth": truth("uav1/odom")}, (0.0, 0.0, 0.0, 0.0)),
        ({"later_s": 2.0}, (0.0, 0.0, 0.0, 0.0)),
    ],
    ids=["scenario", "truth", "odometry by that name", "recorded from later on"],
)
def test_it_begins_at_the_pose_in_a_log_of_volerys(more, begins, flown, tmp_path):
    flown.write(tmp_path / "flight.mcap", holder="scenario", **more)
    result = slam(tmp_path / "flight.mcap", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert ("from the log; --initial-pose overrides it" in result.output) == any(begins)
    start = json.loads((tmp_path / "out" / "summary.json").read_text())["start"]
    np.testing.assert_allclose(start, begins, atol=0.02)
    path = np.loadtxt(tmp_path / "out" / "path.tum")[:, 1:4]
    np.testing.assert_allclose(path[0], begins[:3], atol=0.05)
    delta = path[-1] - path[0]
    assert (delta[1] > 5.0 * abs(delta[0])) == any(begins)  # it flew along its own nose


def test_a_log_of_a_scenario_that_cannot_be_built_begins_at_the_origin(tmp_path, flown):
    flown.write(tmp_path / "flight.mcap", holder="scenario")
    lost = {**ORIGIN, "folder": str(tmp_path / "gone")}
    lost["content"] = {**CONTENT, "world": {"terrain": {"kind": "grid", "file": "no.csv"}}}
    with closing(create_log(tmp_path / "lost.mcap")) as log:
        text = String(json.dumps(lost))
        log.write(Published("/volery/scenario", text.__msgtype__, 0, text))
        for _, topic, message in flown.flight_messages[:50]:
            log.write(Published(f"/uav1/{topic}", message.__msgtype__, 0, message))
    source = open_source(tmp_path / "lost.mcap")
    assert beginning_of(source, "uav1", "/uav1/laser/horizontal/scan") is None
    whole = open_source(tmp_path / "flight.mcap")
    assert beginning_of(whole, "uav1", "/uav1/laser/horizontal/scan") is not None
    assert beginning_of(whole, "uav2", "/uav1/laser/horizontal/scan") is None


def test_a_mount_that_is_not_in_the_log_is_asked_for(flown, tmp_path):
    flown.write(tmp_path / "flight.mcap", holder="nothing")
    refused = slam(tmp_path / "flight.mcap", tmp_path / "out")
    assert refused.exit_code == 2
    assert f"the log has no transform from {NODDING_FRAME}" in refused.output
    assert "--nodding-mount" in refused.output
    assert not (tmp_path / "out").exists()
    result = slam(tmp_path / "flight.mcap", tmp_path / "out", "--nodding-mount", "0.1,0,-0.08")
    assert result.exit_code == 0, result.output


def test_of_several_uavs_it_says_which_one_it_maps(flown, tmp_path):
    flown.write(tmp_path / "flight.mcap", holder="moving", others=("uav2", "uav3"))
    result = slam(tmp_path / "flight.mcap", tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert "warning: mapping uav1; the log also has uav2, uav3: select with --uav" in result.output
    assert "input     uav1: /uav1/laser/horizontal/scan, /uav1/imu, /uav1/laser/n" in result.output
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["uav"] == "uav1"
    assert re.search(r"state     (starting 0\.\d s, )?tracking \d\.\d s", result.output)
    assert "1 session, " in result.output
    asked = slam(tmp_path / "flight.mcap", tmp_path / "out", "--overwrite", "--uav", "uav1")
    assert asked.exit_code == 0, asked.output
    assert "warning: " not in asked.output


@pytest.mark.parametrize(("length", "message"), [(5, "in its first 5 bytes"), (100, "cut off")])
def test_a_log_that_was_cut_off_at_its_beginning_says_so(length, message, flown, tmp_path):
    flown.write(tmp_path / "flight.mcap", holder="moving")
    log = tmp_path / "short.mcap"
    log.write_bytes((tmp_path / "flight.mcap").read_bytes()[:length])
    result = slam(log, tmp_path / "out")
    assert result.exit_code == 2
    assert "cut off" in result.output
    assert message in result.output
