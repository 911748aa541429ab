"""Stereo pairs: what one camera sees, the other sees shifted by fx baseline / depth."""

import cv2
import numpy as np
import pytest

from volery.world.materials import Material

BASELINE = 0.2
PAIR = {
    "kind": "camera",
    "name": "stereo",
    "position_m": [0.1, 0.0, 0.05],
    "stereo": {"baseline_m": BASELINE},
    "noise": False,
}


@pytest.fixture
def look(simulate):
    """The first messages of both cameras of uav1, by topic below its pair, and the fixed frames."""

    def listen(data):
        simulation = simulate(data)
        got = {}
        simulation.graph.subscribe("/tf_static", lambda m: got.setdefault("tf", m.message))
        for side in ("left", "right"):
            for name in ("image_raw", "depth", "camera_info", "labels/material", "points"):
                topic = f"{side}/{name}"
                simulation.graph.subscribe(
                    f"/uav1/stereo/{topic}", lambda m, t=topic: got.setdefault(t, m.message)
                )
        simulation.step(1)
        return got

    return listen


def facing():
    """A UAV whose pair sees another one, 3 m ahead."""
    return {
        "name": "pair",
        "types": {"seer": {"sensors": [{**PAIR, "points": "xyz"}]}, "seen": {}},
        "uavs": [
            {"type": "seer", "position_m": [0.0, 0.0, 20.0]},
            {"type": "seen", "position_m": [3.0, 0.1, 20.0]},
        ],
    }


def depth_of(message):
    return np.asarray(message.data).view("<f4").reshape(message.height, message.width)


def test_a_flat_object_is_shifted_by_its_disparity(look):
    """The plates of the UAV ahead show their fronts, 2.78 m before the cameras."""
    got = look(facing())
    middle = {}
    for side in ("left", "right"):
        depth = depth_of(got[f"{side}/depth"])
        material = np.asarray(got[f"{side}/labels/material"].data).reshape(depth.shape)
        front = (material == Material.UAV_BODY) & (np.abs(depth - 2.78) < 1e-3)
        assert front.sum() > 60
        middle[side] = np.mean(np.nonzero(front), axis=1)
    f = got["left/camera_info"].k[0]
    assert f == pytest.approx(320.0 / np.tan(np.radians(30.0)))  # 60 degrees by default
    row, column = middle["left"] - middle["right"]
    assert column == pytest.approx(f * BASELINE / 2.78, abs=0.5)
    assert abs(row) < 0.1


def test_intrinsics_hold_the_baseline_in_the_frame_of_the_left_camera(look):
    got = look(facing())
    left, right = got["left/camera_info"], got["right/camera_info"]
    assert left.header == right.header == got["right/image_raw"].header
    assert left.header.frame_id == "uav1/stereo/left_optical"
    assert got["right/depth"].header.frame_id == "uav1/stereo/right_optical"
    assert got["right/points"].header.frame_id == "uav1/stereo/right_optical"
    np.testing.assert_array_equal(left.k, right.k)
    assert left.p[3] == 0.0
    assert right.p[3] == pytest.approx(-right.k[0] * BASELINE)
    point = np.array([0.4, -0.2, 5.0, 1.0])  # of the left camera
    seen = [(m @ point)[:2] / 5.0 for m in (left.p.reshape(3, 4), right.p.reshape(3, 4))]
    np.testing.assert_allclose(seen[0] - seen[1], [right.k[0] * BASELINE / 5.0, 0.0], atol=1e-9)
    mounts = {
        t.child_frame_id: (t.header.frame_id, t.transform.translation) for t in got["tf"].transforms
    }
    for side, y in (("left", 0.1), ("right", -0.1)):
        parent, position = mounts[f"uav1/stereo/{side}"]
        assert parent == "uav1/base_link"
        assert (position.x, position.y, position.z) == pytest.approx((0.1, y, 0.05))


def block_matching():
    """It leaves out by itself what has no texture."""
    matcher = cv2.StereoBM_create(64, 15)
    matcher.setTextureThreshold(1000)
    matcher.setUniquenessRatio(15)
    return matcher


def semi_global():
    return cv2.StereoSGBM_create(0, 64, 5, P1=200, P2=800, uniquenessRatio=10, disp12MaxDiff=1)


@pytest.mark.parametrize(("matcher", "ground"), [(block_matching, True), (semi_global, False)])
def test_opencv_finds_the_depth_of_a_wood(look, wood_data, matcher, ground):
    """Of trees; and of ground, where a matcher finds matches except on smooth ground."""
    entry = {**PAIR, "points": "xyz", "rpy_deg": [0.0, -10.0, 0.0]}
    wood_data["types"]["surveyor"] = {"sensors": [entry]}
    wood_data["uavs"] = [
        {"type": "surveyor", "position_m": [15.0, 50.0], "placement": "nearest_free"}
    ]
    got = look(wood_data)
    grey = [
        cv2.cvtColor(
            np.asarray(got[f"{side}/image_raw"].data).reshape(480, 640, 3), cv2.COLOR_RGB2GRAY
        )
        for side in ("left", "right")
    ]
    disparity = matcher().compute(*grey).astype(np.float64) / 16.0
    depth = depth_of(got["left/depth"])
    material = np.asarray(got["left/labels/material"].data).reshape(depth.shape)
    wanted = got["left/camera_info"].k[0] * BASELINE
    seen = (disparity > 0.0) & np.isfinite(depth) & (depth < 20.0)
    seen &= ground | np.isin(material, (Material.WOOD, Material.LEAF))
    assert seen.mean() > 0.04
    assert np.median(np.abs(disparity[seen] - wanted / depth[seen])) < 0.4
    assert np.median(np.abs(wanted / disparity[seen] / depth[seen] - 1.0)) < 0.04


def test_faults_strike_one_camera_of_a_pair(simulate):
    data = facing()
    data["faults"] = [
        {"kind": "sensor", "uav": "uav1", "sensor": "stereo/right", "effect": "dropped"}
    ]
    simulation = simulate(data)
    got = []
    for side in ("left", "right"):
        simulation.graph.subscribe(f"/uav1/stereo/{side}/camera_info", got.append)
    simulation.run(0.15)
    after = {m.topic for m in got if m.time_ns > 0}  # faults strike after the first measurement
    assert after == {"/uav1/stereo/left/camera_info"}
