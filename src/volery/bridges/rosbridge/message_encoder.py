"""Encodes published messages in the forms of rosbridge's clients, each form once."""

from __future__ import annotations

import base64
import secrets
from collections import OrderedDict
from collections.abc import Callable
from itertools import chain, zip_longest
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from volery.bridges.rosbridge.cbor_codec import encode_cbor
from volery.bridges.rosbridge.wire import Frame, encode_json, encode_png
from volery.graph.codecs.json_codec import JsonCodec
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.messages import Published

Generation = Literal["ros1", "ros2"]
"""Generation whose field names (`secs` or `sec`), type names and serialization clients receive."""
COMPRESSIONS = ("none", "png", "cbor", "cbor-raw")

MAX_CACHED = 64
"""Messages stored for further clients, which usually read them in the same turn of the loop."""
MAX_CACHED_BYTES = 32 * 1024 * 1024

_BYTES = {"uint8", "char", "byte"}


class MessageEncoder:
    """Encodes messages for all clients of a server. For one thread."""

    def __init__(self, generation: Generation = "ros2") -> None:
        self.generation = generation
        self._json = JsonCodec(ros1_names=generation == "ros1")
        self._splicing = JsonCodec(ros1_names=generation == "ros1", arrays=self._json_array)
        self._mark = f"<{secrets.token_hex(16)}>"
        """Placeholder of base64 text, which no message contains by chance."""
        self._base64: list[str] = []
        self._cbor = JsonCodec(
            ros1_names=generation == "ros1",
            non_finite_as_null=False,
            arrays=lambda values, _type: values,
        )
        self._cache: OrderedDict[tuple[int, str, str], tuple[Published, Frame]] = OrderedDict()
        self._cache_bytes = 0
        self._makers: dict[str, Callable[[Published, str], Frame]] = {
            "none": self._json_frame,
            "png": lambda published, topic: encode_png(str(self.frame(published, "none", topic))),
            "cbor": self._cbor_frame,
            "cbor-raw": self._raw_frame,
        }

    def plain(self, message: Any, msgtype: str) -> dict[str, Any]:
        """Returns a message as JSON values. Raises `GraphError` if it does not fit its type."""
        return self._json.encode(message, msgtype)

    def frame(self, published: Published, compression: str, topic: str) -> Frame:
        """Returns the `publish` operation of a message under the client's name of the topic.

        Raises
        ------
        GraphError
            The message does not fit its type.
        BridgeError
            The message has no such form.

        """
        key = (id(published), compression, topic)
        kept = self._cache.get(key)
        if kept is not None:
            return kept[1]
        frame = self._makers[compression](published, topic)
        # the message is stored with its form, so that no other message can have its id meanwhile
        self._cache[key] = (published, frame)
        self._cache_bytes += len(frame)
        while len(self._cache) > MAX_CACHED or self._cache_bytes > MAX_CACHED_BYTES:
            _, (_, old) = self._cache.popitem(last=False)
            self._cache_bytes -= len(old)
        return frame

    def _json_frame(self, published: Published, topic: str) -> Frame:
        self._base64.clear()
        plain = self._splicing.encode(published.message, published.msgtype)
        text = encode_json({"op": "publish", "topic": topic, "msg": plain})
        if not self._base64:
            return text
        parts = text.split(self._mark)
        return "".join(chain.from_iterable(zip_longest(parts, self._base64, fillvalue="")))

    def _json_array(self, values: NDArray[Any], base: str) -> Any:
        """Returns an array as JSON.

        Base64 text is inserted later, because the encoder would scan it.
        """
        if base in _BYTES:
            self._base64.append(base64.b64encode(values.data).decode("ascii"))
            return self._mark
        plain: list[Any] = values.tolist()
        if values.dtype.kind == "f":
            for k in np.flatnonzero(~np.isfinite(values)).tolist():
                plain[k] = None
        return plain

    def _cbor_frame(self, published: Published, topic: str) -> Frame:
        plain = self._cbor.encode(published.message, published.msgtype)
        return encode_cbor({"op": "publish", "topic": topic, "msg": plain})

    def _raw_frame(self, published: Published, topic: str) -> Frame:
        if self.generation == "ros1":
            data = ros1_codec().encode(published.message, published.msgtype)
        else:
            data = published.cdr
        secs, nsecs = divmod(published.time_ns, 1_000_000_000)
        raw = {"secs": secs, "nsecs": nsecs, "bytes": data}
        return encode_cbor({"op": "publish", "topic": topic, "msg": raw})
