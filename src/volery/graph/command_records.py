"""Encodes client commands as messages: `volery_interfaces/msg/CommandRecord`.

A record holds its content twice: as shortened JSON for readers, and as CDR, from which the command
can be replayed exactly. A large published message is not written twice: its record says that it
follows.
"""

from __future__ import annotations

import json
from functools import cache
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from volery.graph.codecs.cdr import decode_cdr, encode_cdr
from volery.graph.codecs.json_codec import JsonCodec
from volery.graph.messages import message_type, time_from_ns
from volery.graph.session import ClientCommand
from volery.graph.subscription_queue import array_bytes
from volery.graph.typestore import typestore

TOPIC = "/volery/log"
TYPE = "volery_interfaces/msg/CommandRecord"

_INLINE_BYTES = 4096
"""A message with more bytes in arrays and texts follows its record (modelling choice)."""
_ITEMS_SHOWN = 16
_CHARACTERS_SHOWN = 400
_MAX_CHARACTERS = 8000
"""Limit of the JSON text."""

_PARTS = {
    "call": "_Request",
    "answer": "_Response",
    "goal": "_Goal",
}
"""Suffixes of the content's type."""


def content_type(kind: str, name: str) -> str:
    """Returns the type of a record's content, given the record's kind and type."""
    return name + _PARTS.get(kind, "")


def is_large(command: ClientCommand) -> bool:
    """Returns whether a command is a published message too large for its record."""
    if command.kind != "publish" or not _grows(command.type):
        return False
    return array_bytes(command.content) > _INLINE_BYTES


def content_bytes(command: ClientCommand) -> bytes:
    """Encodes the content of a command. Raises `GraphError` if it does not fit its type."""
    if command.content is None:
        return b""
    if isinstance(command.content, str):
        return command.content.encode()
    return encode_cdr(command.content, content_type(command.kind, command.type))


def content_of(kind: str, type_name: str, cdr: bytes) -> Any:
    """Decodes what `content_bytes` encoded. Raises `GraphError` for other bytes."""
    if not cdr:
        return None
    if kind in ("failure", "refused"):
        return cdr.decode(errors="replace")
    return decode_cdr(cdr, content_type(kind, type_name))


def record_of(
    command: ClientCommand, cdr: bytes | None, *, number: int, time_ns: int, step: int, turn: int
) -> Any:
    """Returns the record of a command; `cdr` is from `content_bytes`, None: it follows."""
    return message_type(TYPE)(
        stamp=time_from_ns(time_ns),
        number=number,
        step=step,
        turn=turn,
        client=command.client,
        kind=command.kind,
        name=command.name,
        type=command.type,
        content=_for_people(command),
        cdr=np.frombuffer(cdr or b"", np.uint8),
        follows=cdr is None,
        latched=command.latched,
        request=command.request,
    )


def _for_people(command: ClientCommand) -> str:
    if command.content is None:
        return ""
    if isinstance(command.content, str):
        return command.content
    plain = _form().encode(command.content, content_type(command.kind, command.type))
    text = json.dumps(_shortened(plain), ensure_ascii=False)
    if len(text) > _MAX_CHARACTERS:
        text = json.dumps({"shortened": text[:_MAX_CHARACTERS]}, ensure_ascii=False)
    return text


@cache
def _grows(msgtype: str) -> bool:
    """Returns whether messages of a type vary in size: the type holds a sequence or text."""
    for _, described in typestore().fielddefs[msgtype][1]:
        kind, detail = cast("tuple[Any, Any]", described)
        if kind == Nodetype.SEQUENCE or (kind == Nodetype.BASE and detail[0] == "string"):
            return True
        inner, name = detail[0] if kind == Nodetype.ARRAY else (kind, detail)
        if inner == Nodetype.NAME and _grows(name):
            return True
    return False


@cache
def _form() -> JsonCodec:
    return JsonCodec(arrays=_array_for_people)


def _array_for_people(array: NDArray[Any], base: str) -> Any:
    if len(array) > _ITEMS_SHOWN:
        return f"{len(array)} x {base}"
    return [_number(value) for value in array.tolist()]


def _number(value: Any) -> Any:
    """Returns None for a number that is not finite, which JSON cannot express."""
    return value if not isinstance(value, float) or np.isfinite(value) else None


def _shortened(plain: Any) -> Any:
    if isinstance(plain, dict):
        return {key: _shortened(value) for key, value in plain.items()}
    if isinstance(plain, list):
        shown = [_shortened(value) for value in plain[:_ITEMS_SHOWN]]
        more = len(plain) - len(shown)
        return [*shown, f"and {more} more"] if more else shown
    if isinstance(plain, str) and len(plain) > _CHARACTERS_SHOWN:
        return f"{plain[:_CHARACTERS_SHOWN]}... ({len(plain)} characters)"
    return plain
