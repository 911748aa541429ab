"""Detects AprilTags in grey images by OpenCV's ArucoDetector."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.extras import import_extra

FAMILY = "36h11"


def load_opencv() -> Any:
    """Returns the module `cv2`. Raises `VoleryError` if it cannot be imported."""
    return import_extra("detection of AprilTags", "cv2", "opencv-python-headless", "vision")


@dataclass(frozen=True, eq=False)
class DetectedTag:
    """A tag in an image."""

    id: int
    """Number in the family."""
    corners_px: Array
    """(4, 2) columns and rows of the black border's corners: top left, top right, bottom right,
    bottom left of the image."""

    @property
    def side_px(self) -> float:
        """Side of a square of the same area, pixels."""
        return float(np.sqrt(quad_area(self.corners_px)))


class TagDetector:
    """Detects tags of family 36h11; corners are refined to fractions of a pixel.

    Raises `VoleryError` if OpenCV is not installed.
    """

    def __init__(self) -> None:
        cv2 = load_opencv()
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        # By default OpenCV drops what comes within 3 pixels of the image's edge, and with the white
        # border's outline the tag inside it, too.
        parameters.minDistanceToBorder = 0
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        self._detector = cv2.aruco.ArucoDetector(dictionary, parameters)

    def detect(self, grey: NDArray[np.uint8]) -> list[DetectedTag]:
        """Returns the tags in an image (height, width), by id, then from left to right."""
        corners, ids, _ = self._detector.detectMarkers(np.ascontiguousarray(grey))
        if ids is None:
            return []
        found = [
            DetectedTag(int(number), np.asarray(quad, np.float64).reshape(4, 2))
            for number, quad in zip(np.ravel(ids).tolist(), corners, strict=True)
        ]
        return sorted(found, key=lambda tag: (tag.id, float(tag.corners_px[:, 0].mean())))


def grey_of(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Returns the luma (..., height, width) of sRGB images (..., height, width, 3).

    Weights of Rec. 601, as in OpenCV's conversion.
    """
    r, g, b = (rgb[..., k].astype(np.uint32) for k in range(3))
    return ((r * 19595 + g * 38470 + b * 7471 + 32768) >> 16).astype(np.uint8)


def quad_area(corners: Array) -> Array:
    """Returns the areas (...) of quadrilaterals (..., 4, 2), at least 0."""
    across, along = corners[..., 2, :] - corners[..., 0, :], corners[..., 3, :] - corners[..., 1, :]
    twice = across[..., 0] * along[..., 1] - across[..., 1] * along[..., 0]
    return np.asarray(0.5 * np.abs(twice))
