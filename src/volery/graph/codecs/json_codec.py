"""Converts messages to and from plain dicts, lists, numbers and strings, the form of rosbridge.

    form = JsonCodec()
    form.encode(twist, "geometry_msgs/msg/Twist")  # {"linear": {"x": 1.0, ...}, ...}
    form.decode({"linear": {"x": 1.0}}, "geometry_msgs/msg/Twist")

Arrays of bytes become base64 text, other arrays lists. A `JsonCodec` with a hook for arrays leaves
them as numpy arrays instead, for CBOR. Converters are built once per type and codec.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys.base import normalize_fieldname

from volery.core.errors import GraphError
from volery.graph.codecs.definition_store import EMPTY_MEMBER
from volery.graph.codecs.json_decoding import (
    BYTES,
    HEADER,
    ROS1_TIME,
    TIMES,
    Convert,
    decode_plain,
    plain_fields,
)
from volery.graph.codecs.ros1 import ros1_codec
from volery.graph.codecs.zero import DTYPES

ArrayHook = Callable[[NDArray[Any], str], Any]
"""Converts an array of numbers, shape (n,), little-endian, and its ROS type to the plain value."""


class JsonCodec:
    """Converts messages to plain values and back.

    Parameters
    ----------
    non_finite_as_null
        NaN and infinite numbers become None, as JSON cannot express them; otherwise they stay
        floats. None is always read as NaN.
    ros1_names
        Writes ROS 1 field names (`secs`, `nsecs`, a header's `seq`, `K` for `k`) and fields. Both
        spellings are always read.
    arrays
        Converts an array of numbers (not bools); without it, bytes become base64 text and other
        arrays lists. With a hook, `non_finite_as_null` does not affect arrays.

    """

    def __init__(
        self,
        *,
        non_finite_as_null: bool = True,
        ros1_names: bool = False,
        arrays: ArrayHook | None = None,
    ) -> None:
        self._null = non_finite_as_null
        self._ros1_names = ros1_names
        self._arrays = arrays
        self._encoders: dict[str, Convert] = {}

    def encode(self, message: Any, msgtype: str) -> dict[str, Any]:
        """Returns the plain form of a message.

        Raises `GraphError` if the type is unknown or the message does not fit the type.
        """
        encoder = self._encoders.get(msgtype) or self._encoder(msgtype)
        try:
            plain: dict[str, Any] = encoder(message)
        except (AttributeError, TypeError, ValueError) as error:
            raise GraphError(f"the message does not fit {msgtype}: {error}") from None
        return plain

    def decode(self, plain: Any, msgtype: str) -> Any:
        """Returns the message of a plain form, see `decode_plain`; ignores the codec's options."""
        return decode_plain(plain, msgtype)

    def _encoder(self, msgtype: str) -> Convert:
        if msgtype in self._encoders:
            return self._encoders[msgtype]
        fields = plain_fields(msgtype)
        described = {name: (normalize_fieldname(name), kind) for name, kind in fields}
        names: list[tuple[str, str | None]] = [(name, name) for name, _ in fields]
        if self._ros1_names and msgtype in TIMES:
            names = [(ROS1_TIME[name], name) for name, _ in fields]
        elif self._ros1_names:
            names = [(old, new) for old, new in ros1_codec().fields(msgtype) if old != EMPTY_MEMBER]
        plan = [
            (old, described[new][0], self._value_encoder(described[new][1]))
            for old, new in names
            if new is not None
        ]

        def encode(message: Any) -> dict[str, Any]:
            return {
                key: getattr(message, name) if convert is None else convert(getattr(message, name))
                for key, name, convert in plan
            }

        def encode_header(message: Any) -> dict[str, Any]:
            return {"seq": 0, **encode(message)}

        with_seq = self._ros1_names and msgtype == HEADER
        self._encoders[msgtype] = encode_header if with_seq else encode
        return self._encoders[msgtype]

    def _value_encoder(self, described: Any) -> Convert | None:
        """Returns the converter of a field; None where the value stays as it is."""
        kind, detail = described
        if kind == Nodetype.NAME:
            return self._encoder(detail)
        if kind == Nodetype.BASE:
            return self._scalar_encoder(detail[0])
        (inner, inner_detail), _ = detail
        if inner == Nodetype.NAME:
            encode = self._encoder(inner_detail)
            return lambda values: [encode(value) for value in values]
        base = inner_detail[0]
        return list if base == "string" else self._array_encoder(base)

    def _array_encoder(self, base: str) -> Convert:
        if self._arrays is not None and base != "bool":
            hook, dtype = self._arrays, DTYPES[base].newbyteorder("<")
            return lambda values: hook(np.ascontiguousarray(values, dtype), base)
        if base in BYTES:
            return _base64_of
        if base.startswith("float") and self._null:
            return _floats_without_nan
        return lambda values: values.tolist()

    def _scalar_encoder(self, base: str) -> Convert | None:
        if base == "string":
            return None
        if base == "bool":
            return bool
        if base.startswith("float"):
            return _float_or_null if self._null else float
        return int


def _float_or_null(value: float) -> float | None:
    number = float(value)
    return number if math.isfinite(number) else None


def _base64_of(values: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).data).decode("ascii")


def _floats_without_nan(values: NDArray[Any]) -> list[float | None]:
    plain: list[float | None] = values.tolist()
    finite = np.isfinite(values)
    if not finite.all():
        for k in np.flatnonzero(~finite).tolist():
            plain[k] = None
    return plain
