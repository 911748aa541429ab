"""Provides the contents of the stand-in for `cv_bridge`: images as arrays, without OpenCV.

Arrays are (height, width) or (height, width, channels), in OpenCV's order of colours where the
encoding is `bgr8`.
"""

from __future__ import annotations

import sys
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import GraphError
from volery.graph.messages import CompressedImage, Header, Image, Time

Pixels = NDArray[Any]

_KINDS = {"8U": "u1", "8S": "i1", "16U": "u2", "16S": "i2", "32S": "i4", "32F": "f4", "64F": "f8"}
_COLOURS = {
    "mono8": ("u1", "y"),
    "mono16": ("u2", "y"),
    "rgb8": ("u1", "rgb"),
    "bgr8": ("u1", "bgr"),
    "rgba8": ("u1", "rgba"),
    "bgra8": ("u1", "bgra"),
    "rgb16": ("u2", "rgb"),
    "bgr16": ("u2", "bgr"),
}
"""Types of numbers and channels of encodings with a meaning."""
_LUMA = np.array([0.299, 0.587, 0.114])
"""Shares of red, green and blue in grey, as in OpenCV (ITU-R BT.601)."""


class CvBridgeError(TypeError, GraphError):
    """Raised for an image that cannot be converted."""


class CvBridge:
    """`cv_bridge.CvBridge`."""

    def imgmsg_to_cv2(self, img_msg: Any, desired_encoding: str = "passthrough") -> Pixels:
        """Returns the pixels of an Image; read-only where they are those of the message.

        desired_encoding: as received, or an encoding with colours. Raises `CvBridgeError`.
        """
        code, channels = _layout(img_msg.encoding)
        dtype = np.dtype((">" if img_msg.is_bigendian else "<") + code)
        height, width = int(img_msg.height), int(img_msg.width)
        length = width * channels * dtype.itemsize
        data = np.frombuffer(img_msg.data, np.uint8)
        step = int(img_msg.step) or length
        if step < length or data.size < step * height:
            raise CvBridgeError(
                f"an image of {width} x {height} in {img_msg.encoding} with rows of {step} bytes "
                f"has {step * height} bytes, not {data.size}"
            )
        rows = data[: step * height].reshape(height, step)[:, :length]
        pixels = np.ascontiguousarray(rows).view(dtype).reshape(height, width, channels)
        pixels = pixels.astype(dtype.newbyteorder("="), copy=False)
        return _converted(pixels, img_msg.encoding, desired_encoding)

    def cv2_to_imgmsg(self, cvim: Pixels, encoding: str = "passthrough", header: Any = None) -> Any:
        """Returns the Image of an array; `passthrough` names its type, such as `8UC3`.

        Raises `CvBridgeError` if the array is not of the encoding.
        """
        found = f"{_kind_of(cvim)}C{1 if cvim.ndim == 2 else cvim.shape[2]}"
        if encoding == "passthrough":
            encoding = found
        code, channels = _layout(encoding)
        if (np.dtype(code), channels) != (np.dtype(_KINDS[found[:-2]]), int(found[-1])):
            raise CvBridgeError(f"an array of {found} is no image in {encoding}")
        pixels = np.ascontiguousarray(cvim)
        return Image(
            header=header or Header(Time(0, 0), ""),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=int(sys.byteorder == "big"),
            step=pixels.strides[0],
            data=np.frombuffer(pixels.tobytes(), np.uint8),
        )

    def compressed_imgmsg_to_cv2(
        self, cmprs_img_msg: Any, desired_encoding: str = "passthrough"
    ) -> Pixels:
        """Returns the pixels of a CompressedImage (JPEG, PNG): `bgr8` or grey, or as desired."""
        from PIL import Image as PilImage
        from PIL import UnidentifiedImageError

        try:
            with PilImage.open(BytesIO(bytes(cmprs_img_msg.data))) as image:
                is_grey = image.mode in ("L", "1", "I;16", "I")
                found = np.asarray(image if is_grey else image.convert("RGB"))
        except (UnidentifiedImageError, OSError) as error:
            raise CvBridgeError(f"the image cannot be decoded: {error}") from None
        if is_grey:
            encoding = "mono8" if found.dtype.itemsize == 1 else "mono16"
            found = found.astype(_COLOURS[encoding][0])[:, :, None]
            wanted = desired_encoding
        else:
            encoding = "rgb8"
            wanted = "bgr8" if desired_encoding == "passthrough" else desired_encoding
        return _converted(found, encoding, wanted)

    def cv2_to_compressed_imgmsg(self, cvim: Pixels, dst_format: str = "jpg") -> Any:
        """Returns the CompressedImage of a grey or `bgr8` array, as `jpg` or `png`."""
        from PIL import Image as PilImage

        if cvim.dtype != np.uint8 or cvim.ndim not in (2, 3):
            raise CvBridgeError(f"an array of {_kind_of(cvim)} cannot be compressed")
        file = BytesIO()
        image = PilImage.fromarray(cvim if cvim.ndim == 2 else cvim[:, :, 2::-1])
        header = Header(Time(0, 0), "")
        image.save(file, "JPEG" if dst_format in ("jpg", "jpeg") else dst_format.upper())
        return CompressedImage(header, dst_format, np.frombuffer(file.getvalue(), np.uint8))


def _layout(encoding: str) -> tuple[str, int]:
    """Returns type of numbers and number of channels. Raises `CvBridgeError`."""
    if encoding in _COLOURS:
        code, colours = _COLOURS[encoding]
        return code, len(colours)
    kind, _, channels = encoding.partition("C")
    if kind in _KINDS and (channels or "1").isdecimal():
        return _KINDS[kind], int(channels or 1)
    raise CvBridgeError(f"Volery's cv_bridge has no encoding '{encoding}'")


def _kind_of(pixels: Pixels) -> str:
    kinds = {np.dtype(code): kind for kind, code in _KINDS.items()}
    if pixels.dtype not in kinds or pixels.ndim not in (2, 3):
        raise CvBridgeError(f"an array of {pixels.dtype}, {pixels.shape}, is no image")
    return kinds[pixels.dtype]


def _converted(pixels: Pixels, encoding: str, wanted: str) -> Pixels:
    """Returns pixels (height, width, channels) in another encoding, without an axis of one."""
    both_mean_colours = wanted in _COLOURS and encoding in _COLOURS
    is_other = wanted not in ("passthrough", encoding)
    if is_other and (both_mean_colours or _layout(wanted) != _layout(encoding)):
        pixels = _recoloured(pixels, encoding, wanted)
    return pixels[:, :, 0] if pixels.shape[2] == 1 else pixels


def _recoloured(pixels: Pixels, encoding: str, wanted: str) -> Pixels:
    if encoding not in _COLOURS or wanted not in _COLOURS:
        raise CvBridgeError(f"an image in {encoding} cannot become one in {wanted}")
    (old_code, old), (new_code, new) = _COLOURS[encoding], _COLOURS[wanted]
    if old_code != new_code:
        scale = 1.0 / 257.0 if new_code == "u1" else 257.0
        pixels = np.rint(pixels * scale).astype(new_code)
    planes = dict(zip(old, np.moveaxis(pixels, 2, 0), strict=True))
    if new == "y" and old != "y":
        colours = np.stack([planes[name] for name in "rgb"], axis=-1)
        grey: Pixels = np.rint(colours @ _LUMA).astype(new_code)[:, :, None]
        return grey
    if old == "y":
        planes = dict.fromkeys("rgb", planes["y"]) | {"y": planes["y"]}
    opaque = np.full(pixels.shape[:2], np.iinfo(new_code).max, new_code)
    return np.stack([planes.get(name, opaque) for name in new], axis=-1)


def contents() -> dict[str, dict[str, Any]]:
    """Returns the names and values of each module."""
    both = {"CvBridge": CvBridge, "CvBridgeError": CvBridgeError}
    return {"cv_bridge": both, "cv_bridge.core": both}
