"""What nodes read from depth images: points in space, means of regions."""

from __future__ import annotations

import numpy as np
import pytest

from volery.autonomy.perception.depth_projection import (
    DepthProjector,
    depth_of,
    mean_depth,
    region_of,
)
from volery.autonomy.perception.scan_points import OdometrySample
from volery.core import rotations
from volery.core.errors import GraphError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import CameraInfo, Image, header

WIDTH, HEIGHT, FOCAL = 40, 30, 25.0


def image(depth, encoding="32FC1"):
    kind = {"32FC1": np.float32, "16UC1": np.uint16, "rgb8": np.uint8}[encoding]
    data = np.ascontiguousarray(depth, kind)
    rows = data.view(np.uint8).reshape(-1)
    return Image(header(0, "c"), HEIGHT, WIDTH, encoding, 0, WIDTH * data.itemsize, rows)


def info():
    message = zero_message("sensor_msgs/msg/CameraInfo")
    message.k = np.array([FOCAL, 0, WIDTH / 2, 0, FOCAL, HEIGHT / 2, 0, 0, 1.0])
    assert isinstance(message, CameraInfo)
    return message


def pose(rpy=(0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0), velocity=(0.0, 0.0, 0.0), time_ns=0):
    position, speed = np.array(position), np.array(velocity)
    return OdometrySample(time_ns, position, rotations.from_rpy(*rpy), speed, np.zeros(3))


def test_pixels_become_points_where_the_camera_looks():
    depth = np.full((HEIGHT, WIDTH), np.nan)
    depth[HEIGHT // 2, WIDTH // 2] = 5.0
    depth[HEIGHT // 2 - 10, WIDTH // 2 + 10] = 4.0  # above, to the right
    projector = DepthProjector([0.2, 0.0, 0.0], keep_every=1)
    points = projector.points(image(depth), info(), pose(position=(1.0, 2.0, 3.0)))
    np.testing.assert_allclose(points, [[1.2 + 4.0, 2.0 - 1.6, 3.0 + 1.6], [6.2, 2.0, 3.0]])


def test_points_turn_with_the_uav_and_are_carried_on():
    depth = np.full((HEIGHT, WIDTH), np.inf)
    depth[HEIGHT // 2, WIDTH // 2] = 5.0
    turned = pose((0.0, 0.0, np.pi / 2), velocity=(2.0, 0.0, 0.0), time_ns=-100_000_000)
    points = DepthProjector([0.2, 0.0, 0.0], keep_every=1).points(image(depth), info(), turned)
    np.testing.assert_allclose(points, [[0.2, 5.2, 0.0]], atol=1e-9)


@pytest.mark.parametrize("distance", [0.1, 12.5, np.inf, np.nan, -np.inf])
def test_what_is_too_near_or_far_is_no_point(distance):
    depth = np.full((HEIGHT, WIDTH), distance)
    assert len(DepthProjector([0.0, 0.0, 0.0]).points(image(depth), info(), pose())) == 0


def test_millimetres_are_read_too():
    depth = np.full((HEIGHT, WIDTH), 2500)
    depth[0, 0] = 0
    metres = depth_of(image(depth, "16UC1"))
    assert metres[1, 1] == pytest.approx(2.5)
    assert np.isnan(metres[0, 0])
    with pytest.raises(GraphError, match="rgb8"):
        depth_of(image(np.zeros((HEIGHT, WIDTH, 3)), "rgb8"))


def test_means_of_regions():
    depth = np.full((HEIGHT, WIDTH), np.inf, np.float32)
    depth[:, : WIDTH // 2] = 2.0
    assert mean_depth(depth, 10.0) == pytest.approx(0.5 * 0.2 + 0.5)
    assert mean_depth(region_of(depth, 0.5, 0.5, -0.25), 10.0) == pytest.approx(0.2)
    assert mean_depth(region_of(depth, 0.5, 0.5, 0.25), 10.0) == 1.0
    assert mean_depth(np.full((3, 3), np.nan, np.float32), 10.0) == 1.0
    assert region_of(depth, 1.0, 1.0).shape == (HEIGHT, WIDTH)
