"""RVL gives the depth that was encoded; damaged data are one error."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from volery.core.errors import VoleryError
from volery.graph import messages as m
from volery.logs.message_arrays import image_array
from volery.logs.rvl import decode_rvl

HEAD = m.header(0, "camera")


def encoded(depth):
    """Encodes (height, width) uint16 number by number, as the paper describes."""
    halves = []

    def add(value):
        while True:
            more = value >> 3
            halves.append((value & 7) | (8 if more else 0))
            value = more
            if not value:
                return

    rest, previous = depth.reshape(-1).tolist(), 0
    while rest:
        zeros = next((k for k, value in enumerate(rest) if value), len(rest))
        rest = rest[zeros:]
        count = next((k for k, value in enumerate(rest) if not value), len(rest))
        add(zeros)
        add(count)
        for value in rest[:count]:
            delta = value - previous
            add(2 * delta if delta >= 0 else -2 * delta - 1)
            previous = value
        rest = rest[count:]
    halves += [0] * (-len(halves) % 8)
    words = [sum(h << (28 - 4 * k) for k, h in enumerate(halves[i : i + 8]))
             for i in range(0, len(halves), 8)]  # fmt: skip
    height, width = depth.shape
    return struct.pack(f"<2I{len(words)}I", width, height, *words)


def compressed(kind, data, a=0.0, b=0.0):
    octets = np.frombuffer(struct.pack("<i2f", 0, a, b) + data, np.uint8)
    return m.CompressedImage(HEAD, f"{kind}; compressedDepth rvl", octets)


@pytest.mark.parametrize(
    "depth",
    [
        np.array([[0, 500]], np.uint16),
        np.zeros((3, 4), np.uint16),
        np.array([[65535, 1, 0], [0, 0, 65535]], np.uint16),
        np.random.default_rng(1).integers(0, 3, (24, 32)).astype(np.uint16) * 21_000,
    ],
    ids=["small", "empty", "extremes", "random"],
)
def test_depth_is_what_was_encoded(depth):
    found = image_array(compressed("16UC1", encoded(depth)))
    assert found.dtype == np.uint16
    assert np.array_equal(found, depth)


def test_words_of_the_published_encoder():
    """One zero, one value of 500: the half bytes 1 1 8 d f 1, by hand."""
    assert decode_rvl(struct.pack("<3I", 2, 1, 0x118DF100)).tolist() == [[0, 500]]


def test_metres_are_quantized_inverses():
    found = image_array(compressed("32FC1", encoded(np.array([[0, 11]], np.uint16)), 100.0, 1.0))
    assert np.isnan(found[0, 0])
    assert found[0, 1] == 10.0


@pytest.mark.parametrize(
    "data",
    [
        b"",
        struct.pack("<2I", 1 << 20, 1 << 20),
        struct.pack("<2I", 2, 1),
        struct.pack("<3I", 2, 1, 0x1F000000),
        struct.pack("<3I", 2, 1, 0xFFFFFFFF),
        struct.pack("<5I", 2, 1, 0xFFFFFFFF, 0xFFFFFFFF, 0xFFFFFFF1),
        encoded(np.full((4, 4), 9, np.uint16))[:-4],
    ],
)
def test_damaged_data(data):
    with pytest.raises(VoleryError, match=r"the image cannot be decoded: .*RVL"):
        image_array(compressed("16UC1", data))
