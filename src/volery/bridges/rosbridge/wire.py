"""Encodes rosbridge v2 frames: operations as JSON text, as CBOR, inside PNG images.

An operation is a dict with the key `op`. A text frame contains JSON, a binary frame CBOR or, from
clients such as ROS#, JSON in UTF-8; the first byte distinguishes them. Large
operations may be sent as a PNG image or in fragments (`bridges.rosbridge.fragments`).
"""

from __future__ import annotations

import base64
import binascii
import json
import math
from io import BytesIO
from typing import Any

import numpy as np

from volery.bridges.rosbridge.cbor_codec import MAX_DEPTH, decode_cbor
from volery.bridges.rosbridge.message_budget import check_cbor, check_json
from volery.core.errors import BridgeError

Frame = str | bytes
"""Content of one WebSocket message."""
Operation = dict[str, Any]

CBOR_PROTOCOL = "rosbridge-cbor"
"""WebSocket subprotocol of clients that may send CBOR."""
MAX_MESSAGE_BYTES = 64 * 1024 * 1024
"""Largest message that a client accepts from a server; `message_budget` has the limits of servers.
"""

_JSON_BEGINS = frozenset(b"{[ \t\r\n\xef")
"""First bytes of JSON text: a value, white space or a byte order mark. CBOR that begins with one of
them is a text, an array, a number or invalid, and none of these is an operation, which is a map."""
_PNG_MAGIC = b"\x89PNG\r\n\x1a\n"


def decode_frame(frame: Frame, *, limited: bool = False) -> Operation:
    """Returns the operation in a frame.

    limited: the frame is from a client and must obey `message_budget`.

    Raises
    ------
    BridgeError
        The frame has no operation, or exceeds the budget.

    """
    if isinstance(frame, bytes) and frame[:1] and frame[0] in _JSON_BEGINS:
        frame = _text_of(frame)
    elif isinstance(frame, bytes) and _is_bson(frame):
        raise BridgeError("BSON is not accepted; send JSON or CBOR")
    if limited:
        check_cbor(frame) if isinstance(frame, bytes) else check_json(frame)
    found = decode_cbor(frame) if isinstance(frame, bytes) else _decode_json(frame)
    if not isinstance(found, dict) or not isinstance(found.get("op"), str):
        raise BridgeError("a message must be an object with the key 'op'")
    return found


def encode_json(operation: Operation) -> str:
    """Returns ASCII JSON text; arrays become lists, bytes base64, non-finite numbers null.

    Raises
    ------
    BridgeError
        The operation has a value without a JSON form.

    """
    try:
        return _dump(operation)
    except ValueError:
        pass  # a non-finite number, which is rare
    except (TypeError, RecursionError) as error:
        raise BridgeError(f"not writable as JSON: {error}") from None
    try:
        return _dump(_with_nulls(operation, 0))
    except (ValueError, TypeError, RecursionError) as error:
        raise BridgeError(f"not writable as JSON: {error}") from None


def encode_png(text: str) -> str:
    """Returns the operation that carries JSON text as an image.

    The image is RGB, nearly square, padded with newlines.
    """
    from PIL import Image

    data = text.encode()
    width = max(1, math.isqrt(len(data) // 3))
    height = math.ceil(len(data) / (3 * width))
    image = Image.frombytes("RGB", (width, height), data.ljust(3 * width * height, b"\n"))
    file = BytesIO()
    image.save(file, "png", compress_level=1)
    return encode_json({"op": "png", "data": base64.b64encode(file.getvalue()).decode("ascii")})


def decode_png(operation: Operation, max_bytes: int, *, limited: bool = False) -> Operation:
    """Returns the operation in an image of at most `max_bytes` pixel bytes; `limited`: as above.

    Raises
    ------
    BridgeError
        There is no image, it is too large, or it has no operation.

    """
    from PIL import Image, UnidentifiedImageError

    text = operation.get("data")
    if not isinstance(text, str):
        raise BridgeError("png: 'data' must be base64 text")
    try:
        data = base64.b64decode(text, validate=True)
        if not data.startswith(_PNG_MAGIC):
            raise BridgeError("png: 'data' is not a PNG image")
        with Image.open(BytesIO(data), formats=("PNG",)) as image:
            if 3 * image.width * image.height > max_bytes:
                raise BridgeError(f"png: more than {max_bytes} bytes of pixels")
            pixels = image.convert("RGB").tobytes()
        inside = pixels.decode().rstrip("\n")
    except (binascii.Error, UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        raise BridgeError(f"png: not readable: {error}") from None
    found = decode_frame(inside, limited=limited)
    if found["op"] == "png":
        raise BridgeError("png: an image inside an image")
    return found


def _text_of(frame: bytes) -> str:
    """Returns the JSON text of a binary frame."""
    try:
        return frame.decode()
    except UnicodeDecodeError as error:
        raise BridgeError(f"not readable as JSON: {error}") from None


def _is_bson(frame: bytes) -> bool:
    """Returns whether bytes begin with their own number and end with zero, as a BSON document."""
    return int.from_bytes(frame[:4], "little") == len(frame) and frame[-1:] == b"\0"


def _decode_json(text: str) -> Any:
    try:
        return json.loads(text.removeprefix("\ufeff").rstrip("\0"))  # C strings carry their end
    except (ValueError, RecursionError) as error:
        raise BridgeError(f"not readable as JSON: {error}") from None


def _dump(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), allow_nan=False, default=_plain)


def _plain(value: Any) -> Any:
    """Converts values that arrive as CBOR and leave as JSON."""
    if isinstance(value, np.ndarray):
        if value.dtype == np.uint8:
            return base64.b64encode(value.tobytes()).decode("ascii")
        return value.tolist()
    if isinstance(value, (bytes, bytearray)):
        return base64.b64encode(value).decode("ascii")
    raise TypeError(f"a {type(value).__name__}")


def _with_nulls(value: Any, depth: int) -> Any:
    if depth > 2 * MAX_DEPTH:
        raise ValueError("nested too deeply")
    if isinstance(value, dict):
        return {key: _with_nulls(inner, depth + 1) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_with_nulls(inner, depth + 1) for inner in value]
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        return _with_nulls(value.tolist(), depth + 1)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
