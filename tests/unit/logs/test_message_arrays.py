"""Images of each encoding give the pixels that were encoded."""

from __future__ import annotations

import numpy as np
import pytest

from volery.core.errors import VoleryError
from volery.graph import messages as m
from volery.logs.message_arrays import cloud_array, image_array
from volery.publishing import image_codecs

HEAD = m.header(0, "camera")


@pytest.mark.parametrize(
    ("encoding", "pixels"),
    [
        ("rgb8", np.arange(18, dtype=np.uint8).reshape(2, 3, 3)),
        ("mono8", np.arange(6, dtype=np.uint8).reshape(2, 3)),
        ("16UC1", np.arange(6, dtype=np.uint16).reshape(2, 3)),
        ("32FC1", np.arange(6, dtype=np.float32).reshape(2, 3)),
    ],
)
@pytest.mark.parametrize("is_bigendian", [0, 1])
def test_raw_images(encoding, pixels, is_bigendian):
    stored = pixels.astype(pixels.dtype.newbyteorder(">" if is_bigendian else "<"))
    data = np.frombuffer(stored.tobytes(), np.uint8)
    message = m.Image(HEAD, 2, 3, encoding, is_bigendian, len(data) // 2, data)
    found = image_array(message)
    assert np.array_equal(found, pixels)
    assert found.dtype == pixels.dtype


def test_blue_first_becomes_red_first():
    data = np.array([1, 2, 3, 255], np.uint8)
    found = image_array(m.Image(HEAD, 1, 1, "bgra8", 0, 4, data))
    assert found[0, 0].tolist() == [3, 2, 1, 255]


def test_compressed_colours_and_depth():
    colours = np.full((8, 8, 3), (200, 30, 30), np.uint8)
    png = m.CompressedImage(HEAD, "png", image_codecs.png(colours))
    assert np.array_equal(image_array(png), colours)
    jpeg = m.CompressedImage(HEAD, "rgb8; jpeg compressed bgr8", image_codecs.jpeg(colours, 95))
    assert np.abs(image_array(jpeg).astype(int) - colours).max() < 8
    depth = np.array([[1.0, 10.0], [50.0, np.inf]], np.float32)
    packed = m.CompressedImage(
        HEAD, "32FC1; compressedDepth png", image_codecs.packed_metres(depth, 100.0)
    )
    found = image_array(packed)
    assert np.allclose(found[0], [1.0, 10.0], atol=0.01)
    assert abs(found[1, 0] - 50.0) < 0.3
    assert np.isnan(found[1, 1])
    millimetres = np.array([[1000, 0]], np.uint16)
    packed = m.CompressedImage(
        HEAD, "16UC1; compressedDepth png", image_codecs.packed_millimetres(millimetres)
    )
    assert image_array(packed).tolist() == [[1000, 0]]


@pytest.mark.parametrize(
    "message",
    [
        m.Image(HEAD, 2, 3, "rgb8", 0, 9, np.zeros(5, np.uint8)),
        m.CompressedImage(HEAD, "png", np.zeros(5, np.uint8)),
        m.CompressedImage(HEAD, "32FC1; compressedDepth png", np.zeros(5, np.uint8)),
    ],
    ids=["raw", "png", "depth"],
)
def test_damaged_images_are_one_error(message):
    with pytest.raises(VoleryError, match="the image cannot be decoded"):
        image_array(message)


def test_unknown_encodings_and_damaged_clouds():
    with pytest.raises(VoleryError, match="encoding 'yuv422' cannot be read"):
        image_array(m.Image(HEAD, 1, 1, "yuv422", 0, 2, np.zeros(2, np.uint8)))
    field = m.PointField("x", 0, m.PointField.FLOAT32, 1)
    with pytest.raises(VoleryError, match="the point cloud cannot be decoded"):
        cloud_array(m.PointCloud2(HEAD, 1, 2, [field], False, 4, 8, np.zeros(7, np.uint8), True))


def padded(height, width, row_step, more=0, fields=None, big=False):
    """Points x = 0, 1, 2, ... with 8 bytes, in rows of `row_step` bytes."""
    points = np.zeros((height, row_step), np.uint8)
    x = np.arange(height * width, dtype=">f4" if big else "<f4").reshape(height, width)
    for k in range(width):
        points[:, 8 * k : 8 * k + 4] = x[:, k : k + 1].view(np.uint8)
    data = np.concatenate([points.reshape(-1), np.zeros(more, np.uint8)])
    fields = [m.PointField("x", 0, m.PointField.FLOAT32, 1)] if fields is None else fields
    return m.PointCloud2(HEAD, height, width, fields, big, 8, row_step, data, True)


NAMELESS = m.PointField("", 4, m.PointField.UINT8, 4)
X = m.PointField("x", 0, m.PointField.FLOAT32, 1)


@pytest.mark.parametrize(
    ("cloud", "count"),
    [
        (padded(2, 3, 24), 6),
        (padded(2, 3, 28), 6),
        (padded(1, 3, 28), 3),  # one row, padded
        (padded(2, 3, 24, more=5), 6),
        (padded(1, 3, 24, more=5), 3),
        (padded(2, 2, 20, big=True), 4),
        (padded(1, 2, 16, fields=[X, NAMELESS, NAMELESS]), 2),  # padding of several names
        (padded(0, 0, 0), 0),
        (padded(3, 0, 0), 0),
    ],
)
def test_clouds_as_drivers_lay_them_out(cloud, count):
    points = cloud_array(cloud)
    assert points["x"].tolist() == list(range(count))


def test_clouds_without_points_and_with_unknown_fields():
    assert cloud_array(m.PointCloud2()).shape == (0,)
    with pytest.raises(VoleryError, match="field 'x' has the unknown datatype 9"):
        cloud_array(padded(1, 2, 16, fields=[m.PointField("x", 0, 9, 1)]))


@pytest.mark.parametrize("encoding", ["8UC5", "16SC1", "bayer_rggb16"])
def test_further_encodings(encoding):
    found = image_array(m.Image(HEAD, 1, 1, encoding, 0, 0, np.arange(5 if "5" in encoding else 2,
                                                                     dtype=np.uint8)))  # fmt: skip
    assert found.ravel().tolist() == ([0, 1, 2, 3, 4] if "5" in encoding else [256])


def test_bytes_after_the_last_row_of_an_image():
    found = image_array(m.Image(HEAD, 2, 2, "mono8", 0, 3, np.arange(8, dtype=np.uint8)))
    assert found.tolist() == [[0, 1], [3, 4]]
