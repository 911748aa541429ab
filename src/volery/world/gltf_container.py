"""Bytes of glTF 2.0 files: JSON, buffers, and the arrays in them.

Sizes stated by a file are checked before memory is allocated. Errors are `ValueError` without the
file's name. Khronos Group, glTF 2.0 Specification, sections 3.6 (binary data storage) and 4 (GLB).
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.core.plurals import counted

_HEAD, _CHUNK = struct.Struct("<4sII"), struct.Struct("<II")
_MAGIC = b"glTF"
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
"""Components of an element; meshes without textures need no others."""


def field(holder: dict[str, Any], key: str, kind: type, default: Any = None) -> Any:
    """Returns a value of type `kind` of a JSON object; required without a default.

    Raises `ValueError` if the value is missing or of another type.
    """
    value = holder.get(key, default)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise ValueError(f"'{key}' is {str(value)[:40]!r}, not {_NAMES[kind]}")
    return value


def entry(holder: dict[str, Any], key: str, number: Any) -> dict[str, Any]:
    """Returns object `number` of the list `key`; raises `ValueError` if it does not exist."""
    entries = field(holder, key, list, [])
    if not isinstance(number, int) or not 0 <= number < len(entries):
        raise ValueError(
            f"'{key}' has {counted(len(entries), 'entry', 'entries')}; there is none of "
            f"number {number!r}"
        )
    found = entries[number]
    if not isinstance(found, dict):
        raise ValueError(f"'{key}' {number} is not an object")
    return found


def numbers(holder: dict[str, Any], key: str, count: int | None, default: Sequence[float]) -> Array:
    """Returns a list of numbers of a JSON object; count: their number, None for any.

    Raises `ValueError` if one is not a number below 1e30, or their number is another.
    """
    values = field(holder, key, list, list(default))
    if count not in (None, len(values)) or not all(
        isinstance(value, int | float) and abs(value) < 1e30 for value in values
    ):
        raise ValueError(f"'{key}' needs {'' if count is None else f'{count} '}finite numbers")
    return np.array(values, dtype=np.float64)


_NAMES = {int: "an integer", list: "a list", dict: "an object", str: "text"}


class Container:
    """A file's JSON, and the arrays that its accessors describe."""

    def __init__(self, path: Path, max_bytes: int) -> None:
        self._folder = path.parent
        self._bytes_left = max_bytes
        self._buffers: dict[int, bytes] = {}
        data = path.read_bytes()
        if data.startswith(_MAGIC):
            data = self._unpack(data)
        try:
            document = json.loads(data)
        except ValueError as error:
            reason = error if isinstance(error, json.JSONDecodeError) else "no text"
            raise ValueError(f"it is neither binary glTF nor JSON ({reason})") from None
        if not isinstance(document, dict):
            raise ValueError("its JSON is not an object")
        version = field(field(document, "asset", dict), "version", str)
        if version.split(".")[0] != "2":
            raise ValueError(f"glTF 2 is read, this is version '{version[:20]}'")
        self.document = document

    def count(self, number: Any) -> int:
        """Returns the number of elements that accessor `number` states."""
        count: int = field(entry(self.document, "accessors", number), "count", int)
        if count < 0:
            raise ValueError(f"accessor {number} has {count} elements")
        return count

    def is_zero(self, number: Any) -> bool:
        """Returns whether accessor `number` has no data: all its elements are zero."""
        accessor = entry(self.document, "accessors", number)
        return not {"bufferView", "sparse"} & accessor.keys()

    def array(self, number: Any, form: str) -> NDArray[Any]:
        """Returns the elements (count, width) of accessor `number`, which has the type `form`."""
        accessor = entry(self.document, "accessors", number)
        count, kind = self.count(number), _component(accessor)
        if accessor.get("type") != form:
            raise ValueError(f"accessor {number} is {accessor.get('type')!r}, not {form}")
        width = _WIDTHS[form]
        if "bufferView" in accessor:
            found = self._elements(accessor, count, kind, width)
        elif "sparse" in accessor:
            found = np.zeros((count, width), kind)
        else:
            raise ValueError(f"accessor {number} has no data")
        if "sparse" in accessor:
            found = self._replaced(found, field(accessor, "sparse", dict))
        is_fraction = accessor.get("normalized", False) and kind.kind != "f"
        if not is_fraction:
            return found
        return np.asarray(np.maximum(found / np.float64(np.iinfo(kind).max), -1.0))

    # ------------------------------------------------------------------------------------ buffers

    def _unpack(self, data: bytes) -> bytes:
        """Returns the JSON of a GLB; its binary chunk becomes buffer 0."""
        if len(data) < _HEAD.size:
            raise ValueError("it ends within its head")
        _, version, _ = _HEAD.unpack_from(data)
        if version != 2:
            raise ValueError(f"it is binary glTF of version {version}; version 2 is read")
        at = _HEAD.size
        chunks: list[tuple[int, bytes]] = []
        while at + _CHUNK.size <= len(data) and len(chunks) < 2:
            length, name = _CHUNK.unpack_from(data, at)
            at += _CHUNK.size
            if at + length > len(data):
                raise ValueError(f"a chunk of {length} bytes has only {len(data) - at}")
            chunks.append((name, data[at : at + length]))
            at += length
        if not chunks or chunks[0][0] != _JSON:
            raise ValueError("its first chunk is not JSON")
        if len(chunks) > 1 and chunks[1][0] == _BINARY:
            self._buffers[0] = chunks[1][1]
        return chunks[0][1]

    def _buffer(self, number: Any) -> bytes:
        buffer = entry(self.document, "buffers", number)
        if number not in self._buffers:
            self._buffers[number] = self._fetched(field(buffer, "uri", str))
            self._bytes_left -= len(self._buffers[number])
        return self._buffers[number]

    def _fetched(self, uri: str) -> bytes:
        """Returns the bytes of a data URI, or of a file in the glTF file's folder or below."""
        if uri.startswith("data:"):
            head, comma, code = uri.partition(",")
            if not comma or not head.endswith(";base64"):
                raise ValueError(f"a buffer's URI begins with '{uri[:40]}', not 'data:...;base64,'")
            try:
                return base64.b64decode(code, validate=True)
            except binascii.Error as error:
                raise ValueError(f"a buffer is not base64: {error}") from None
        path = (self._folder / unquote(uri)).resolve()
        if not path.is_relative_to(self._folder.resolve()):
            raise ValueError(f"buffer '{uri[:80]}' lies outside of the file's folder")
        try:
            size = path.stat().st_size
            if size > self._bytes_left:
                raise ValueError(f"buffer '{uri[:80]}' has {size / 1e6:.0f} MB, too many")
            return path.read_bytes()
        except OSError as error:
            raise ValueError(f"buffer '{uri[:80]}' cannot be read: {error.strerror}") from None

    # ------------------------------------------------------------------------------------- arrays

    def _elements(
        self, holder: dict[str, Any], count: int, kind: np.dtype[Any], width: int
    ) -> NDArray[Any]:
        """Returns elements (count, width) of the buffer view that `holder` names."""
        number = holder.get("bufferView")
        view = entry(self.document, "bufferViews", number)
        packed = kind.itemsize * width
        stride = field(view, "byteStride", int, packed)
        begin, length = field(view, "byteOffset", int, 0), field(view, "byteLength", int)
        offset = field(holder, "byteOffset", int, 0)
        if stride < packed or min(begin, length, offset) < 0:
            raise ValueError(f"the stride or an offset of buffer view {number} is invalid")
        data = memoryview(self._buffer(view.get("buffer")))[begin : begin + length]
        if count and offset + (count - 1) * stride + packed > len(data):
            raise ValueError(f"buffer view {number} has {len(data)} bytes: too few for {count}")
        if not count:
            return np.empty((0, width), kind)
        return np.ndarray((count, width), kind, data, offset, (stride, kind.itemsize))

    def _replaced(self, found: NDArray[Any], sparse: dict[str, Any]) -> NDArray[Any]:
        """Returns the array with some of its elements replaced."""
        count = field(sparse, "count", int)
        indices, values = field(sparse, "indices", dict), field(sparse, "values", dict)
        if not 0 <= count <= len(found):
            raise ValueError(f"{count} of {len(found)} elements are replaced")
        at = self._elements(indices, count, _component(indices), 1)[:, 0]
        if count and not (at.dtype.kind == "u" and at.max() < len(found)):
            raise ValueError("a replaced element does not exist")
        changed = found.copy()
        changed[at] = self._elements(values, count, found.dtype, found.shape[1])
        return changed


def _component(holder: dict[str, Any]) -> np.dtype[Any]:
    code = field(holder, "componentType", int)
    if code not in _COMPONENTS:
        raise ValueError(f"component type {code} is none of {sorted(_COMPONENTS)}")
    return np.dtype(_COMPONENTS[code])
