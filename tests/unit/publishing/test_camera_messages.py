"""Tests camera messages as decoded by cv_bridge, image_transport and OpenCV."""

import struct

import cv2
import numpy as np
import pytest

from volery.core.errors import ScenarioError
from volery.publishing import image_codecs
from volery.scenario.load import parse_scenario
from volery.sensors.cameras.bank import CameraBank
from volery.sensors.cameras.depth_units import millimetres
from volery.sensors.cameras.model import CameraModel

TYPES = {"rgb8": ("u1", 3), "bgr8": ("u1", 3), "mono8": ("u1", 1), "32FC1": ("f4", 1),
         "16UC1": ("u2", 1), "32SC1": ("i4", 1)}  # fmt: skip
"""Numbers and channels of encodings, by sensor_msgs/image_encodings.hpp."""


def as_array(image):
    """An image of a message by cv_bridge's rule: rows of `step` bytes in the stated byte order."""
    kind, channels = TYPES[image.encoding]
    number = np.dtype(kind).newbyteorder(">" if image.is_bigendian else "<")
    shape = (image.height, image.width, channels)
    strides = (image.step, number.itemsize * channels, number.itemsize)
    array = np.ndarray(shape, number, bytes(image.data), strides=strides)
    return array[..., 0] if channels == 1 else array


def scenario(**camera):
    """A UAV on level ground whose camera sees ground and sky."""
    entry = {"kind": "camera", "position_m": [0.3, 0.0, 0.8], "rpy_deg": [0.0, 15.0, 0.0]}
    entry |= {"width": 96, "height": 72, "noise": False, **camera}
    return {
        "name": "look",
        "types": {"f450": {"sensors": [entry]}},
        "uavs": [{"type": "f450", "position_m": [0.0, 0.0]}],
    }


@pytest.fixture
def look(simulate):
    """The first message on each of some topics of a camera."""

    def listen(*suffixes, **camera):
        simulation = simulate(scenario(**camera))
        got = {}
        for suffix in suffixes:
            simulation.graph.subscribe(
                f"/uav1/camera/{suffix}", lambda m, s=suffix: got.setdefault(s, m.message)
            )
        simulation.step(20)
        return [got[suffix] for suffix in suffixes]

    return listen


def test_a_camera_without_receivers_renders_nothing(simulate, monkeypatch):
    rendered = []
    sample = CameraBank.sample

    def noted(bank, k, time_ns, fleet):
        rendered.append(k)
        return sample(bank, k, time_ns, fleet)

    monkeypatch.setattr(CameraBank, "sample", noted)
    simulation = simulate(scenario())
    simulation.run(0.3)
    assert rendered == []
    simulation.graph.subscribe("/uav1/camera/depth", lambda _message: None)
    simulation.run(0.3)
    assert rendered


def test_raw_images_by_the_rules_of_cv_bridge(look):
    colour, depth, instance, material = map(
        as_array, look("image_raw", "depth", "labels/instance", "labels/material")
    )
    assert colour.shape == (72, 96, 3)
    assert depth.dtype == np.float32
    assert depth.shape == instance.shape == material.shape == (72, 96)
    sky, ground = depth == np.inf, np.isfinite(depth)
    assert sky.sum() > 1000
    assert ground.sum() > 1000
    np.testing.assert_array_equal(instance == -1, sky)
    bgr = cv2.cvtColor(colour, cv2.COLOR_RGB2BGR)  # what cv_bridge makes of rgb8 for "bgr8"
    blue, _, red = (bgr[..., k].astype(float) for k in range(3))
    assert blue[sky].mean() > red[sky].mean() + 20  # the sky is blue, the ground is not
    assert blue[ground].mean() < red[ground].mean()


def test_depth_in_millimetres(look):
    (metres,) = look("depth")
    (whole,) = look("depth", depth_encoding="16UC1")
    assert (whole.encoding, whole.step) == ("16UC1", 2 * 96)
    seen, expected = as_array(whole), as_array(metres).astype(np.float64)
    known = expected <= 65.535
    assert known.any()
    assert (expected[~known] > 65.535).any()
    np.testing.assert_array_equal(seen[~known], 0)
    np.testing.assert_allclose(seen[known] / 1000.0, expected[known], atol=0.5001e-3)


def test_millimetres_of_what_is_not_known_are_zero():
    depth = np.array([[np.nan, np.inf, -np.inf, 65.535, 65.536, 1.0004]], np.float32)
    np.testing.assert_array_equal(millimetres(depth), [[0, 0, 0, 65535, 0, 1000]])


def test_jpeg_is_the_image_within_its_loss(look):
    raw, packed = look("image_raw", "image_raw/compressed")
    (coarse,) = look("image_raw/compressed", jpeg_quality=20)
    assert packed.format == "rgb8; jpeg compressed bgr8"
    bgr = cv2.cvtColor(as_array(raw), cv2.COLOR_RGB2BGR)
    decoded = cv2.imdecode(packed.data, cv2.IMREAD_COLOR)
    assert cv2.PSNR(decoded, bgr) > 35.0
    assert cv2.PSNR(cv2.imdecode(coarse.data, cv2.IMREAD_COLOR), bgr) > 25.0
    assert len(coarse.data) < 0.6 * len(packed.data) < 0.3 * raw.data.size
    assert packed.header == raw.header


def test_png_is_the_image(look):
    raw, packed = look("image_raw", "image_raw/compressed", compressed="png")
    assert packed.format == "rgb8; png compressed bgr8"
    decoded = cv2.imdecode(packed.data, cv2.IMREAD_COLOR)
    np.testing.assert_array_equal(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB), as_array(raw))


def unpacked(message):
    """Kind and parameters of a compressedDepth message's header, and its 16-bit image."""
    data = bytes(message.data)
    png = np.frombuffer(data[12:], np.uint8)
    return struct.unpack("<iff", data[:12]), cv2.imdecode(png, cv2.IMREAD_UNCHANGED)


def test_compressed_depth_in_metres(look):
    """Decoded by compressed_depth_image_transport's formula, steps are z^2 / A."""
    raw, packed = look("depth", "depth/compressedDepth")
    assert packed.format == "32FC1; compressedDepth png"
    (kind, a, b), coded = unpacked(packed)
    assert kind == 0
    assert coded.dtype == np.uint16
    depth = as_array(raw).astype(np.float64)
    np.testing.assert_array_equal(coded == 0, ~np.isfinite(depth))
    seen = np.isfinite(depth)
    back = a / (coded[seen] - b)
    assert depth[seen].max() > 50.0
    assert (np.abs(back - depth[seen]) <= depth[seen] * back / a * 1.01).all()


def test_compressed_depth_beyond_16_bits_is_unknown():
    depth = np.array([[0.1, 0.2, 199.0, 200.0, np.nan, np.inf, -np.inf]], np.float32)
    data = bytes(image_codecs.packed_metres(depth, 200.0))
    coded = cv2.imdecode(np.frombuffer(data[12:], np.uint8), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(coded > 0, [[False, True, True, False, False, False, False]])


def test_compressed_depth_in_millimetres_loses_nothing(look):
    raw, packed = look("depth", "depth/compressedDepth", depth_encoding="16UC1")
    assert packed.format == "16UC1; compressedDepth png"
    _, coded = unpacked(packed)
    np.testing.assert_array_equal(coded, as_array(raw))


@pytest.mark.parametrize("points", ["xyz", "xyzrgb"])
def test_points_stand_where_the_pixels_see(look, points):
    colour, depth, cloud, info = look("image_raw", "depth", "points", "camera_info", points=points)
    names = ["x", "y", "z", "rgb"][: 4 if points == "xyzrgb" else 3]
    assert [(f.name, f.offset, f.datatype, f.count) for f in cloud.fields] == [
        (name, 4 * k, 7, 1) for k, name in enumerate(names)
    ]
    assert (cloud.height, cloud.width, cloud.is_dense) == (72, 96, False)
    assert (cloud.point_step, cloud.row_step) == (4 * len(names), 4 * len(names) * 96)
    assert cloud.header.frame_id == "uav1/camera_optical"
    numbers = np.asarray(cloud.data).view("<f4").reshape(72, 96, len(names))
    z = as_array(depth)
    known = np.isfinite(z)
    assert np.isnan(numbers[~known][:, :3]).all()
    np.testing.assert_array_equal(numbers[known][:, 2], z[known])
    v, u = np.nonzero(known)
    pixels, _ = cv2.projectPoints(
        numbers[known][:, :3].astype(np.float64), np.zeros(3), np.zeros(3),
        info.k.reshape(3, 3), info.d,
    )  # fmt: skip
    np.testing.assert_allclose(pixels[:, 0], np.stack([u, v], -1), atol=1e-3)
    if points == "xyzrgb":
        packed = np.asarray(cloud.data).view("<u4").reshape(72, 96, 4)[..., 3]
        rgb = np.stack([packed >> 16, packed >> 8 & 255, packed & 255], -1)
        np.testing.assert_array_equal(rgb, as_array(colour))


def test_only_what_somebody_receives_is_coded(look, monkeypatch):
    def refuse(*_arguments):
        raise AssertionError("not requested")

    for name in ("jpeg", "png", "packed_metres", "packed_millimetres"):
        monkeypatch.setattr(image_codecs, name, refuse)
    look("image_raw", "depth", points="xyzrgb")
    with pytest.raises(AssertionError, match="not requested"):
        look("image_raw/compressed")


def test_what_is_switched_off_is_not_offered(simulate):
    def topics(**camera):
        graph = simulate(scenario(**camera)).graph
        below = "/uav1/camera/"
        return {t.name.removeprefix(below) for t in graph.topics() if t.name.startswith(below)}

    plain = {"image_raw", "depth", "camera_info", "labels/instance", "labels/material"}
    packed = {"image_raw/compressed", "depth/compressedDepth"}
    assert topics() == plain | packed
    assert topics(compressed="none", points="xyz") == plain | {"points"}


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [("jpeg_quality", 0, "1"), ("compressed", "webp", "png"), ("depth_encoding", "mono16", "16UC1"),
     ("points", "rgb", "xyzrgb")],
)  # fmt: skip
def test_wrong_keys_are_refused(key, value, allowed):
    with pytest.raises(ScenarioError, match=key) as refused:
        parse_scenario(scenario(**{key: value}))
    assert allowed in str(refused.value)


LENS = (-0.25, 0.08, 0.002, -0.003, 0.01)


@pytest.mark.parametrize("distortion", [(0.0,) * 5, LENS])
def test_the_lens_is_opencvs(distortion):
    model = CameraModel(width=640, height=480, distortion=distortion)
    draw = np.random.default_rng(3)
    points = draw.uniform([-0.5, -0.4, 1.0], [0.5, 0.4, 1.0], (200, 3)) * draw.uniform(
        1.0, 30.0, (200, 1)
    )
    theirs, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), model.matrix, np.array(distortion)
    )
    np.testing.assert_allclose(model.project(points), theirs[:, 0], atol=1e-9)
    v, u = np.mgrid[0:480:20, 0:640:20].reshape(2, -1)
    seen = np.column_stack([model.ideal[v, u], np.ones(len(u))]).astype(np.float64)
    pixels, _ = cv2.projectPoints(
        seen, np.zeros(3), np.zeros(3), model.matrix, np.array(distortion)
    )
    np.testing.assert_allclose(pixels[:, 0], np.stack([u, v], -1), atol=1e-3)


def test_an_undistorted_image_is_that_of_an_ideal_lens(look, tmp_path):
    """cv2 rectifies by CameraInfo what a distorting lens saw; an ideal lens sees the same."""
    model = tmp_path / "wide.toml"
    model.write_text(f'name = "wide"\nwidth = 320\nheight = 240\ndistortion = {list(LENS)}\n')
    size = {"width": 320, "height": 240}
    seen, info = look("image_raw", "camera_info", model=str(model), **size)
    (ideal,) = look("image_raw", **size)
    assert (info.distortion_model, info.height, info.width) == ("plumb_bob", 240, 320)
    across, down = cv2.initUndistortRectifyMap(
        info.k.reshape(3, 3), info.d, info.r.reshape(3, 3), info.p.reshape(3, 4)[:, :3],
        (info.width, info.height), cv2.CV_32FC1,
    )  # fmt: skip
    rectified = cv2.remap(as_array(seen), across, down, cv2.INTER_LINEAR)
    same = cv2.undistort(as_array(seen), info.k.reshape(3, 3), info.d)
    assert np.abs(rectified.astype(int) - same.astype(int)).max() <= 3
    inner = (slice(30, 210), slice(40, 280))

    def off(image):
        return np.abs(image[inner].astype(int) - as_array(ideal)[inner].astype(int)).mean()

    assert off(rectified) < 0.5 * off(as_array(seen))
    assert off(rectified) < 4.0
