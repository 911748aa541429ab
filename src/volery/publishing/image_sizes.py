"""Estimates the log size of a camera's messages."""

from __future__ import annotations

from volery.scenario.camera import CameraSensor

_LABELS_INSTANCE, _LABELS_MATERIAL = 0.5, 0.2
_RAW_COLOUR, _PNG_COLOUR, _JPEG_COLOUR = 3.0, 1.8, 0.5
_RAW_DEPTH = {"32FC1": 3.8, "16UC1": 1.0}
_COMPRESSED_DEPTH = 1.2
_POINTS = 15.0
"""Bytes per pixel after LZ4 in a log, for a forest by day: measured on `forest_cameras`."""


def bytes_per_image(settings: CameraSensor, pixels: int) -> dict[str, float]:
    """Returns the approximate log size of an image in bytes, by topic suffix.

    pixels: number of pixels of an image.
    """
    compressed = _JPEG_COLOUR if settings.compressed == "jpeg" else _PNG_COLOUR
    each = {
        "/image_raw": _RAW_COLOUR,
        "/image_raw/compressed": compressed if settings.compressed != "none" else 0.0,
        "/depth": _RAW_DEPTH[settings.depth_encoding],
        "/depth/compressedDepth": _COMPRESSED_DEPTH if settings.compressed != "none" else 0.0,
        "/points": _POINTS if settings.points != "none" else 0.0,
        "/labels/instance": _LABELS_INSTANCE,
        "/labels/material": _LABELS_MATERIAL,
    }
    return {end: size * pixels for end, size in each.items() if size}
