"""Messages of the right type with values that are hard to take, anywhere in them."""

from __future__ import annotations

import copy

import numpy as np
from rosbags.interfaces import Nodetype
from whole_world import NASTY_TEXTS, nasty_values

from volery.graph.codecs.zero import zero_message
from volery.graph.typestore import typestore

FLOATS = (float("nan"), float("inf"), -float("inf"), 1e308, -1e308, -1.0, 0.0)
_DUMMY = "structure_needs_at_least_one_member"


def plausible(msgtype):
    """A message with something in all that it holds: one message in each list, a unit rotation."""
    message = zero_message(msgtype)
    for name, (kind, detail) in _fields(msgtype):
        if kind == Nodetype.NAME:
            setattr(message, name, plausible(detail))
        elif kind == Nodetype.SEQUENCE and detail[0][0] == Nodetype.NAME:
            setattr(message, name, [plausible(detail[0][1])])
    if msgtype == "geometry_msgs/msg/Quaternion":
        message.w = 1.0
    if msgtype == "std_msgs/msg/Header":
        message.frame_id = "map"
    return message


def poisoned(base):
    """Copies of a message: all its numbers or texts of a kind nasty, its lists, or one field."""
    for value in FLOATS:
        yield _with_all(base, "float", value)
    for number in (1, -1, 10**30):
        yield _with_all(base, "int", number)
    for text in NASTY_TEXTS:
        yield _with_all(base, "string", text)
    for length in (0, 3, 100_000):
        yield _with_lists(base, length)
    for number, (_, _, described) in enumerate(_spots(base)):
        for value in nasty_values(described)[-1:]:
            message = copy.deepcopy(base)
            owner, name, _ = _spots(message)[number]
            setattr(owner, name, value)
            yield message


def _fields(msgtype):
    return [field for field in typestore().fielddefs[msgtype][1] if field[0] != _DUMMY]


def _spots(message):
    """All fields that hold no message: what holds them, their names and types."""
    found = []
    for name, described in _fields(message.__msgtype__):
        kind, detail = described
        value = getattr(message, name)
        if kind == Nodetype.NAME:
            found += _spots(value)
        elif kind != Nodetype.BASE and detail[0][0] == Nodetype.NAME:
            for item in list(value)[:3]:
                found += _spots(item)
        else:
            found.append((message, name, described))
    return found


def _with_all(base, word, value):
    """A copy whose numbers of a kind, in arrays too, are this value, or the next that they hold."""
    message = copy.deepcopy(base)
    for owner, name, (kind, detail) in _spots(message):
        base_name = detail[0] if kind == Nodetype.BASE else detail[0][1][0]
        if word not in base_name or base_name in ("bool",):
            continue
        fitting = _fitting(base_name, value)
        if kind == Nodetype.BASE:
            setattr(owner, name, fitting)
        elif base_name == "string":
            setattr(owner, name, [fitting] * max(1, len(getattr(owner, name))))
        else:
            setattr(owner, name, np.full_like(getattr(owner, name), fitting))
    return message


def _fitting(base_name, value):
    if base_name == "float32":
        limit = float(np.finfo(np.float32).max)
        return value if np.isnan(value) or np.isinf(value) else float(np.clip(value, -limit, limit))
    if "int" in base_name:
        info = np.iinfo(base_name)
        return int(min(max(value, int(info.min)), int(info.max)))
    return value


def _with_lists(base, length):
    """A copy whose lists, of messages too, have this many members."""
    message = copy.deepcopy(base)
    for name, (kind, _) in _fields(message.__msgtype__):
        value = getattr(message, name)
        if kind == Nodetype.NAME:
            setattr(message, name, _with_lists(value, length))
        elif kind == Nodetype.SEQUENCE:
            if isinstance(value, np.ndarray):
                longer = np.resize(value, length) if len(value) else np.zeros(length, value.dtype)
                setattr(message, name, longer)
            elif len(value):
                setattr(message, name, [copy.copy(value[0]) for _ in range(min(length, 2000))])
    return message
