"""Finding a colour in an image and placing it on the ground."""

from __future__ import annotations

import colorsys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.autonomy.perception.scan_points import OdometrySample
from volery.autonomy.search.colour_blob import ColourRange, colour_mask, largest_blob, pixels_of
from volery.autonomy.search.ground_view import GroundView, Intrinsics, pose_at
from volery.core import rotations
from volery.core.errors import GraphError
from volery.graph.messages import Image, header

RANGES = [
    ColourRange(),
    ColourRange(345.0, 15.0, 0.0, 0.0),
    ColourRange(90.0, 150.0, 0.4, 0.5),
    ColourRange(200.0, 260.0, 0.9, 0.1),
]


def in_range(pixel, colours):
    """By Python's own conversion."""
    hue, saturation, value = colorsys.rgb_to_hsv(*(pixel / 255.0))
    if saturation == 0.0:
        return False  # grey has no hue
    first, last = colours.first_hue_deg, colours.last_hue_deg
    hue *= 360.0
    right = (hue >= first or hue <= last) if first > last else first <= hue <= last
    return right and saturation >= colours.min_saturation and value >= colours.min_value


@pytest.mark.parametrize("colours", RANGES)
def test_thresholds_are_those_of_colorsys(colours):
    random = np.random.default_rng(3)
    pixels = random.integers(0, 256, (60, 70, 3)).astype(np.uint8)
    pixels[:6] = random.integers(0, 4, (6, 70, 3))  # dark ones, greys among them
    wanted = np.array([[in_range(p, colours) for p in row] for row in pixels])
    found = colour_mask(pixels, colours)
    assert 0 < wanted.sum() < wanted.size
    # colours that lie on a threshold may fall on either side by rounding
    assert (found != wanted).sum() <= 2


def test_red_goes_around_the_circle():
    row = [[255, 0, 40], [255, 40, 0], [255, 255, 0], [0, 255, 0], [0, 0, 255], [99, 99, 99]]
    mask = colour_mask(np.array([row], np.uint8), ColourRange())
    assert mask[0].tolist() == [True, True, False, False, False, False]


def test_the_largest_patch_counts_alone():
    mask = np.zeros((20, 30), bool)
    mask[2:5, 3:7] = True  # 12 pixels
    mask[10:14, 20:25] = True  # 20
    mask[14, 25] = True  # by a corner
    mask[0, 29] = True
    blob = largest_blob(mask)
    v, u = np.argwhere(mask[9:])[:, 0] + 9, np.argwhere(mask[9:])[:, 1]
    assert blob.pixels == 21
    assert blob.fraction == pytest.approx(21 / 600)
    assert (blob.u, blob.v) == pytest.approx((u.mean(), v.mean()))
    assert largest_blob(np.zeros((5, 5), bool)) is None


def test_teammates_are_blotted_out():
    red = np.zeros((40, 40, 3), np.uint8)
    red[..., 0] = 200
    discs = np.array([[10.0, 12.0, 5.0], [-3.0, 45.0, 8.0], [1e9, -1e9, 4.0]])
    mask = colour_mask(red, ColourRange(), discs)
    v, u = np.mgrid[:40, :40]
    hidden = [(u - x) ** 2 + (v - y) ** 2 <= r * r for x, y, r in discs]
    np.testing.assert_array_equal(mask, ~np.any(hidden, axis=0))


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8"])
def test_encodings_and_padded_rows(encoding):
    rows = np.zeros((2, 16), np.uint8)
    rows[:, :12] = np.arange(24).reshape(2, 12)
    pixels = pixels_of(Image(header(0, ""), 2, 4, encoding, 0, 16, rows.ravel()))
    assert pixels.shape == (2, 4, 3)
    assert pixels[1, 0].tolist() == ([12, 13, 14] if encoding == "rgb8" else [14, 13, 12])


def test_other_encodings_are_refused():
    with pytest.raises(GraphError, match="rgb8 or bgr8, not 'mono8'"):
        pixels_of(Image(header(0, ""), 1, 1, "mono8", 0, 1, np.zeros(1, np.uint8)))


LENS = Intrinsics(290.0, 291.0, 160.0, 118.0)
MOUNT, MOUNT_RPY_DEG = [-0.12, 0.02, 0.01], [3.0, 85.0, -2.0]
angle, metre = st.floats(-0.3, 0.3), st.floats(-50.0, 50.0)


def seen_at(pose, position):
    """Returns the pixel of a position, step by step: map, body, mount, optical frame, pinhole."""
    body = rotations.matrix(pose.attitude).T @ (position - pose.position)
    roll, pitch, yaw = np.radians(MOUNT_RPY_DEG)
    ahead, left, up = rotations.matrix(rotations.from_rpy(roll, pitch, yaw)).T @ (body - MOUNT)
    return LENS.fx * -left / ahead + LENS.cx, LENS.fy * -up / ahead + LENS.cy


@given(metre, metre, st.floats(4.0, 40.0), angle, angle, st.floats(-3.0, 3.0), angle, angle)
def test_a_position_on_the_ground_is_found_from_its_pixel(x, y, z, roll, pitch, yaw, dx, dy):
    attitude = rotations.from_rpy(roll, pitch, yaw)
    pose = OdometrySample(0, np.array([x, y, z]), attitude, np.zeros(3), np.zeros(3))
    position = np.array([x + dx * z, y + dy * z, 0.5])
    view = GroundView(LENS, MOUNT, MOUNT_RPY_DEG)
    u, v = seen_at(pose, position)
    np.testing.assert_allclose(view.position_of(u, v, pose, 0.5), position, atol=1e-6)
    disc = view.disc_of(position, 0.5, pose)
    assert disc[:2] == pytest.approx((u, v), abs=1e-6)


@given(st.floats(0.05, 0.5), st.floats(0.05, 0.5))
def test_the_error_by_height_is_as_stated(off_axis, height):
    """A part dz above the plane is placed dz tan(angle) too far."""
    eye = np.array([0.0, 0.0, 10.0])
    pose = OdometrySample(0, eye, np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), np.zeros(3))
    view = GroundView(LENS, [0.0, 0.0, 0.0], [0.0, 90.0, 0.0])
    part = np.array([(10.0 - height) * np.tan(off_axis), 0.0, height])
    u, v, _ = view.disc_of(part, 0.1, pose)
    error = view.position_of(u, v, pose, 0.0)[0] - part[0]
    assert error == pytest.approx(height * np.tan(off_axis), rel=1e-9)


def test_flat_rays_and_eyes_below_the_plane_find_nothing():
    view = GroundView(LENS, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])  # looks at the horizon
    level = OdometrySample(
        0, np.array([0.0, 0.0, 9.0]), np.array([0, 0, 0, 1.0]), np.zeros(3), np.zeros(3)
    )
    assert view.position_of(160.0, 118.0, level, 0.0) is None
    assert view.position_of(160.0, 140.0, level, 0.0) is None
    assert view.position_of(160.0, 239.0, level, 0.0) is not None
    assert view.position_of(160.0, 239.0, level, 9.5) is None
    assert view.disc_of(np.array([-5.0, 0.0, 9.0]), 0.5, level) is None


def test_a_pose_is_extrapolated_to_the_image():
    turning = OdometrySample(
        0,
        np.array([1.0, 2.0, 3.0]),
        np.array([0.0, 0.0, 0.0, 1.0]),
        np.array([1.0, 0.0, -1.0]),
        np.array([0.0, 0.0, 0.5]),
    )
    later = pose_at(turning, 100_000_000)
    np.testing.assert_allclose(later.position, [1.1, 2.0, 2.9])
    assert later.yaw == pytest.approx(0.05)
