"""Geometry of typed samples: points of LIDARs and cameras in named frames."""

import numpy as np
import pytest

from volery.core import rotations

SENSORS = [
    {
        "kind": "lidar",
        "name": "nodding",
        "position_m": [0.1, 0.0, -0.08],
        "rpy_deg": [0.0, 20.0, 30.0],
        "nodding": {"amplitude_deg": 45.0, "period_s": 2.0},
    },
    {
        "kind": "camera",
        "name": "down",
        "width": 32,
        "height": 24,
        "position_m": [0.0, 0.0, -0.05],
        "rpy_deg": [0.0, 90.0, 0.0],
    },
]


@pytest.fixture
def hovering(simulate, flat_data):
    """A UAV that hovers level at 3 m with a nodding LIDAR and a camera that looks down."""
    flat_data["types"]["f450"]["sensors"] += SENSORS
    flat_data["uavs"] = [{"type": "f450", "position_m": [5.0, -2.0, 3.0], "yaw_deg": 40.0}]
    simulation = simulate(flat_data)
    simulation.run(0.2)
    return simulation


def on_map(uav, points):
    return rotations.rotate(uav.attitude, points) + uav.position_map


def test_points_of_a_nodding_lidar_lie_on_the_ground(hovering):
    uav, seen = hovering.uavs["uav1"], 0
    for scan in uav.sensors["nodding"].samples(seconds=2.0):
        points = scan.points_base()
        assert points.shape == scan.points_sensor().shape
        assert points.shape[0] == np.isfinite(scan.ranges).sum()
        height = on_map(uav, points)[:, 2]
        assert np.abs(height).max(initial=0.0) < 0.25
        seen += len(points)
    assert seen > 5000


def test_points_of_a_camera_lie_on_the_ground(hovering):
    sample = hovering.uavs["uav1"].sensors["down"].next()
    points = sample.points_optical()
    assert np.nanmedian(points[..., 2]) == pytest.approx(2.95, abs=0.05)
    x = (points[12, 20, 0] / points[12, 20, 2]) * sample.intrinsics[0, 0] + sample.intrinsics[0, 2]
    assert x == pytest.approx(20.0, abs=0.01)
    assert sample.distortion.shape == (5,)
    assert sample.depth_mm().dtype == np.uint16
    assert np.median(sample.depth_mm()) == pytest.approx(2950, abs=50)


def test_beams_have_directions_times_and_intensities(hovering):
    scan = hovering.uavs["uav1"].sensors["nodding"].latest
    beams = len(scan.ranges)
    assert scan.directions.shape == (beams, 3)
    np.testing.assert_allclose(np.linalg.norm(scan.directions, axis=1), 1.0)
    assert scan.beam_times_ns.shape == (beams,)
    assert scan.beam_times_ns[0] == 0
    assert scan.intensities.shape in ((0,), (beams,))
    assert scan.number == hovering.uavs["uav1"].sensors["nodding"].latest.number
