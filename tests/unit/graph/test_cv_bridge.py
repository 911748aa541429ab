"""Images as arrays, as `cv_bridge` gives them."""

import numpy as np
import pytest

from volery.graph.messages import Header, Image
from volery.graph.nodes.cv_bridge import CvBridge, CvBridgeError

BRIDGE = CvBridge()
COLOURS = np.arange(2 * 3 * 3, dtype=np.uint8).reshape(2, 3, 3)


def image(pixels, encoding):
    return BRIDGE.cv2_to_imgmsg(pixels, encoding)


@pytest.mark.parametrize(
    ("pixels", "encoding"),
    [
        (COLOURS, "bgr8"),
        (COLOURS, "rgb8"),
        (COLOURS[:, :, 0], "mono8"),
        (COLOURS[:, :, :2], "8UC2"),
        (np.array([[1.5, np.nan]], np.float32), "32FC1"),
        (np.array([[1, 65535]], np.uint16), "16UC1"),
        (np.array([[1, 65535]], np.uint16), "mono16"),
    ],
)
def test_both_directions(pixels, encoding):
    message = image(pixels, encoding)
    assert (message.encoding, message.height, message.width) == (encoding, *pixels.shape[:2])
    back = BRIDGE.imgmsg_to_cv2(message)
    assert back.dtype == pixels.dtype
    np.testing.assert_array_equal(back, pixels)


def test_colours_are_reordered():
    message = image(COLOURS, "rgb8")
    np.testing.assert_array_equal(BRIDGE.imgmsg_to_cv2(message, "bgr8"), COLOURS[:, :, ::-1])
    np.testing.assert_array_equal(BRIDGE.imgmsg_to_cv2(message, "rgb8"), COLOURS)
    opaque = BRIDGE.imgmsg_to_cv2(message, "bgra8")
    np.testing.assert_array_equal(opaque[:, :, :3], COLOURS[:, :, ::-1])
    assert (opaque[:, :, 3] == 255).all()
    grey = BRIDGE.imgmsg_to_cv2(
        image(np.full((1, 1, 3), (200, 100, 50), np.uint8), "rgb8"), "mono8"
    )
    assert grey.tolist() == [[round(0.299 * 200 + 0.587 * 100 + 0.114 * 50)]]
    assert BRIDGE.imgmsg_to_cv2(image(grey, "mono8"), "bgr8").tolist() == [[[grey[0, 0]] * 3]]


def test_rows_with_padding_and_the_other_byte_order():
    rows = [[0, 1, 0, 2, 9, 9], [0, 3, 0, 4, 9, 9]]
    data = np.array(rows, np.uint8).ravel()
    message = Image(Header(), 2, 2, "16UC1", 1, 6, data)
    assert BRIDGE.imgmsg_to_cv2(message).tolist() == [[1, 2], [3, 4]]


def test_passthrough_names_the_type():
    assert BRIDGE.cv2_to_imgmsg(COLOURS).encoding == "8UC3"
    assert BRIDGE.cv2_to_imgmsg(np.zeros((1, 1), np.float32)).encoding == "32FC1"
    header = Header(frame_id="camera")
    assert BRIDGE.cv2_to_imgmsg(COLOURS, "bgr8", header=header).header is header


def test_compressed():
    flat = np.full((16, 16, 3), (10, 100, 200), np.uint8)  # blue, green, red
    for form, tolerance in (("png", 0), ("jpg", 4)):
        message = BRIDGE.cv2_to_compressed_imgmsg(flat, form)
        assert message.format == form
        found = BRIDGE.compressed_imgmsg_to_cv2(message)
        assert np.abs(found.astype(int) - flat).max() <= tolerance
        red_first = BRIDGE.compressed_imgmsg_to_cv2(message, "rgb8")
        np.testing.assert_array_equal(red_first, found[:, :, ::-1])
    grey = BRIDGE.cv2_to_compressed_imgmsg(flat[:, :, 0], "png")
    np.testing.assert_array_equal(BRIDGE.compressed_imgmsg_to_cv2(grey), flat[:, :, 0])


@pytest.mark.parametrize(
    "attempt",
    [
        lambda: BRIDGE.cv2_to_imgmsg(COLOURS, "mono8"),
        lambda: BRIDGE.cv2_to_imgmsg(COLOURS.astype(np.float32), "bgr8"),
        lambda: BRIDGE.cv2_to_imgmsg(np.zeros(3, np.uint8)),
        lambda: BRIDGE.imgmsg_to_cv2(Image(encoding="yuv422")),
        lambda: BRIDGE.imgmsg_to_cv2(image(COLOURS, "8UC3"), "bgr8x"),
        lambda: BRIDGE.imgmsg_to_cv2(image(np.zeros((1, 1), np.float32), "32FC1"), "bgr8"),
        lambda: BRIDGE.imgmsg_to_cv2(Image(Header(), 2, 2, "bgr8", 0, 6, np.zeros(5, np.uint8))),
    ],
)
def test_what_is_no_image_is_refused(attempt):
    with pytest.raises(CvBridgeError):
        attempt()
