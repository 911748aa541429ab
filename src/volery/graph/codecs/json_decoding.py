"""Converts plain dicts, lists, numbers and strings of clients to messages, and checks them.

Decoders are built once per type.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from volery.core.errors import GraphError
from volery.core.plurals import counted
from volery.graph.codecs.definition_files import INTEGER_RANGES, NUMBERS
from volery.graph.codecs.definition_store import EMPTY_MEMBER
from volery.graph.codecs.zero import DTYPES, value_maker
from volery.graph.messages import single
from volery.graph.typestore import typestore

Convert = Callable[[Any], Any]

BYTES = {"uint8", "char", "byte"}
"""Types whose arrays are encoded as base64 text."""
HEADER = "std_msgs/msg/Header"
TIMES = {"builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"}
ROS1_TIME = {"sec": "secs", "nanosec": "nsecs"}
"""Names of a time's fields in rosbridge for ROS 1."""
_LARGEST_FLOAT32 = float(np.finfo(np.float32).max)
_SHOWN_LETTERS = 40
_NAMED_FLOATS = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}
"""Texts that JSON writers of .NET, such as that of ROS#, put in place of a number."""


class _Mismatch(Exception):  # noqa: N818 - becomes a GraphError once its path is known
    """Raised for a value that does not fit; callers prepend the path to the value."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.text = text
        self.path = ""

    def inside(self, part: str) -> _Mismatch:
        joint = "." if self.path and not self.path.startswith("[") else ""
        self.path = f"{part}{joint}{self.path}"
        return self


def decode_plain(plain: Any, msgtype: str) -> Any:
    """Returns the message of a plain form, such as parsed JSON or CBOR. Its arrays are read-only.

    Omitted fields are zero, or have the default of their definition file. Arrays may be lists or
    one-dimensional numpy arrays, arrays of bytes also base64 text or bytes. Times may be {sec,
    nanosec} or {secs, nsecs}; a header's `seq` is ignored.

    Raises `GraphError` if the type is unknown, or a value does not fit: "linear.x must be a number,
    not 'abc'".
    """
    decoder = _decoders.get(msgtype) or _decoder(msgtype)
    try:
        return decoder(plain)
    except _Mismatch as mismatch:
        where = mismatch.path or f"a {msgtype}"
        raise GraphError(f"{where} {mismatch.text}") from None


_decoders: dict[str, Convert] = {}


def plain_fields(msgtype: str) -> list[tuple[str, Any]]:
    """Returns the names and types of a type's fields; raises `GraphError` if it is unknown."""
    store = typestore()
    if msgtype not in store.fielddefs:
        raise GraphError(f"unknown message type '{msgtype}'")
    return [(name, kind) for name, kind in store.fielddefs[msgtype][1] if name != EMPTY_MEMBER]


_KINDS: list[tuple[Any, str]] = [
    (Mapping, "an object"),
    ((list, tuple), "a list"),
    ((bytes, bytearray), "bytes"),
    (type(None), "null"),
]


def _shown(value: Any) -> str:
    """Returns a value, or its kind, for an error message."""
    for kind, name in _KINDS:
        if isinstance(value, kind):
            return name
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype} of shape {value.shape}"
    if isinstance(value, int) and value.bit_length() > 128:
        return "a number of many digits"  # str() raises an exception
    text = str(value).lower() if isinstance(value, bool) else repr(value)
    return text if len(text) <= _SHOWN_LETTERS else text[: _SHOWN_LETTERS - 3] + "..."


def _decoder(msgtype: str) -> Convert:
    if msgtype in _decoders:
        return _decoders[msgtype]
    fields = plain_fields(msgtype)
    store = typestore()
    cls: Any = store.types[msgtype]
    plan = [
        (name, _value_decoder(kind), value_maker(kind, store.default_of(msgtype, name)))
        for name, kind in fields
    ]
    names = {name for name, _ in fields}
    aliases = _aliases(msgtype, names)

    def decode(plain: Any) -> Any:
        if not isinstance(plain, Mapping):
            raise _Mismatch(f"must be an object, not {_shown(plain)}")
        if not plain.keys() <= names:
            plain = _renamed(plain, names, aliases)
        values = []
        name = ""
        try:
            for name, convert, zero in plan:
                values.append(convert(plain[name]) if name in plain else zero())
        except _Mismatch as mismatch:
            raise mismatch.inside(name) from None
        return cls(*values)

    _decoders[msgtype] = decode
    return decode


def _aliases(msgtype: str, names: set[str]) -> dict[str, str | None]:
    """Returns other spellings of fields; None for fields that ROS 2 dropped."""
    aliases: dict[str, str | None] = {name.upper(): name for name in names if len(name) == 1}
    if msgtype in TIMES:
        aliases |= {old: new for new, old in ROS1_TIME.items()}
    if msgtype == HEADER:
        aliases["seq"] = None
    if "default_value" in names:
        aliases["default"] = "default_value"  # rosapi's GetParam
    return {old: new for old, new in aliases.items() if old not in names}


def _renamed(
    plain: Mapping[Any, Any], names: set[str], aliases: dict[str, str | None]
) -> dict[str, Any]:
    """Returns the plain form with ROS 2 field names."""
    found = {}
    for name, value in plain.items():
        if name in names:
            found[name] = value
        elif name in aliases:
            new = aliases[name]
            if new is not None:
                if new in plain:
                    raise _Mismatch(f"is also given as '{new}'").inside(name)
                found[new] = value
        else:
            known = ", ".join(sorted(names)) or "none"
            raise _Mismatch(f"is not a field (fields: {known})").inside(_label(name))
    return found


def _label(name: Any) -> str:
    return name[:_SHOWN_LETTERS] if isinstance(name, str) else _shown(name)


def _value_decoder(described: Any) -> Convert:
    kind, detail = described
    if kind == Nodetype.NAME:
        return _decoder(detail)
    if kind == Nodetype.BASE:
        return _scalar_decoder(*detail)
    (inner, inner_detail), size = detail
    exact = size if kind == Nodetype.ARRAY else None
    limit = size if kind == Nodetype.SEQUENCE and size else None

    def check(length: int) -> None:
        if exact is not None and length != exact:
            raise _Mismatch(f"must have {counted(exact, 'element')}, not {length}")
        if limit is not None and length > limit:
            raise _Mismatch(f"must have at most {counted(limit, 'element')}, not {length}")

    if inner == Nodetype.BASE and inner_detail[0] in NUMBERS:
        return _array_decoder(inner_detail[0], check)
    decode = _decoder(inner_detail) if inner == Nodetype.NAME else _scalar_decoder(*inner_detail)

    def decode_list(values: Any) -> Any:
        if not isinstance(values, (list, tuple)):
            raise _Mismatch(f"must be a list, not {_shown(values)}")
        check(len(values))
        found: list[Any] = []
        try:
            for value in values:
                found.append(decode(value))
        except _Mismatch as mismatch:
            raise mismatch.inside(f"[{len(found)}]") from None
        return found

    return decode_list


def _scalar_decoder(base: str, limit: int) -> Convert:
    if base == "string":

        def decode_string(value: Any) -> str:
            if not isinstance(value, str):
                raise _Mismatch(f"must be a string, not {_shown(value)}")
            if limit and len(value) > limit:
                raise _Mismatch(
                    f"must have at most {counted(limit, 'character')}, not {len(value)}"
                )
            if not value.isascii():
                try:
                    value.encode()
                except UnicodeEncodeError:
                    raise _Mismatch("contains half a surrogate pair, not UTF-8") from None
            return value

        return decode_string
    if base == "bool":
        return _decode_bool
    if base.startswith("float"):
        return _decode_float32 if base == "float32" else _decode_float
    return _integer_decoder(base)


def _decode_bool(value: Any) -> bool:
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    raise _Mismatch(f"must be true or false, not {_shown(value)}")


def _decode_float(value: Any) -> float:
    if type(value) is float:
        return value
    if value is None:
        return math.nan
    if isinstance(value, str) and value in _NAMED_FLOATS:
        return _NAMED_FLOATS[value]
    if isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool):
        try:
            return float(value)
        except OverflowError:
            raise _Mismatch(f"does not fit float64: {_shown(value)}") from None
    raise _Mismatch(f"must be a number, not {_shown(value)}")


def _decode_float32(value: Any) -> float:
    number = _decode_float(value)
    if abs(number) > _LARGEST_FLOAT32 and not math.isinf(number):
        raise _Mismatch(f"does not fit float32: {_shown(value)}")
    return single(number)


def _integer_decoder(base: str) -> Convert:
    minimum, maximum = INTEGER_RANGES[base]
    wraps = base == "byte"

    def decode(value: Any) -> int:
        if type(value) is not int:
            # JavaScript and CBOR have one kind of number: 5.0 may be the integer 5
            whole = isinstance(value, (float, np.floating)) and float(value).is_integer()
            if not whole and not isinstance(value, np.integer):
                raise _Mismatch(f"must be an integer, not {_shown(value)}")
        number = int(value)
        if not minimum <= number <= maximum:
            raise _Mismatch(f"must be {minimum} to {maximum}, not {_shown(number)}")
        return number - 256 if wraps and number > 127 else number

    return decode


def _array_decoder(base: str, check: Callable[[int], None]) -> Convert:
    """Returns the decoder of an array of numbers to a read-only numpy array."""
    dtype = DTYPES[base]
    one = _scalar_decoder(base, 0)
    is_float = base.startswith("float")

    def decode(values: Any) -> NDArray[Any]:
        if isinstance(values, (list, tuple)):
            check(len(values))
            found = _from_list(values)
        elif isinstance(values, np.ndarray):
            found = _from_array(values)
        elif base in BYTES and isinstance(values, (str, bytes, bytearray, memoryview)):
            found = np.frombuffer(_bytes_of(values), dtype)
            check(len(found))
        else:
            text = "a list or base64 text" if base in BYTES else "a list"
            raise _Mismatch(f"must be {text}, not {_shown(values)}")
        found.setflags(write=False)
        return found

    def _from_list(values: Any) -> NDArray[Any]:
        kinds = set(map(type, values))
        if is_float and kinds <= {float, int, type(None)}:
            try:
                found = np.array(values, np.float64)  # None becomes NaN
            except OverflowError:
                return np.array(_one_by_one(values), dtype)
            return found if dtype == np.float64 else _to_float32(found)
        if base not in ("byte", "bool") and not is_float and kinds == {int}:
            minimum, maximum = INTEGER_RANGES[base]
            if minimum <= min(values) and max(values) <= maximum:
                return np.array(values, dtype)
        return np.array(_one_by_one(values), dtype)

    def _one_by_one(values: Any) -> list[Any]:
        numbers: list[Any] = []
        try:
            for value in values:
                numbers.append(one(value))
        except _Mismatch as mismatch:
            raise mismatch.inside(f"[{len(numbers)}]") from None
        return numbers

    def _to_float32(values: NDArray[np.float64]) -> NDArray[np.float32]:
        large = (np.abs(values) > _LARGEST_FLOAT32) & np.isfinite(values)
        if large.any():
            k = int(np.flatnonzero(large)[0])
            raise _Mismatch(f"does not fit float32: {float(values[k])}").inside(f"[{k}]")
        return values.astype(np.float32)

    def _from_array(values: NDArray[Any]) -> NDArray[Any]:
        if values.ndim != 1 or values.dtype.kind not in "biuf":
            raise _Mismatch(f"must be a list of numbers, not {_shown(values)}")
        check(len(values))
        same = values.dtype.newbyteorder("=") == dtype
        if same or (is_float and dtype == np.float64 and values.dtype.kind == "f"):
            return values.astype(dtype)
        return _from_list(values.tolist())

    return decode


def _bytes_of(values: Any) -> bytes:
    if not isinstance(values, str):
        return bytes(values)
    try:
        return base64.b64decode(values, validate=True)
    except (binascii.Error, ValueError):
        pass  # in lines, as MIME has it (RFC 2045)
    try:
        return base64.b64decode("".join(values.split()), validate=True)
    except (binascii.Error, ValueError):
        raise _Mismatch("must be base64 text (RFC 4648) or a list") from None
