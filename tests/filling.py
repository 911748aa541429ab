"""Messages with a different value in every field, and their comparison bit by bit."""

from __future__ import annotations

from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.base import normalize_fieldname

from volery.graph.codecs.definition_files import INTEGER_RANGES
from volery.graph.codecs.definition_store import EMPTY_MEMBER
from volery.graph.codecs.zero import DTYPES
from volery.graph.typestore import typestore


def filled(msgtype: str, rng: np.random.Generator) -> Any:
    store = typestore()
    fields = [f for f in store.fielddefs[msgtype][1] if f[0] != EMPTY_MEMBER]
    return store.types[msgtype](*[_value(described, rng) for _, described in fields])


def _value(described: Any, rng: np.random.Generator) -> Any:
    kind, detail = described
    if kind == Nodetype.NAME:
        return filled(detail, rng)
    if kind == Nodetype.BASE:
        return _scalar(*detail, rng)
    (inner, inner_detail), size = detail
    count = size if kind == Nodetype.ARRAY else int(rng.integers(0, min(size or 3, 3) + 1))
    if inner == Nodetype.NAME:
        return [filled(inner_detail, rng) for _ in range(count)]
    if inner_detail[0] == "string":
        return [_scalar(*inner_detail, rng) for _ in range(count)]
    array = np.array([_scalar(*inner_detail, rng) for _ in range(count)], DTYPES[inner_detail[0]])
    array.setflags(write=False)
    return array


def _scalar(base: str, limit: int, rng: np.random.Generator) -> Any:
    if base == "string":
        return "grün 𝄞 "[: limit or None] + "x" * int(rng.integers(0, 3))
    if base == "bool":
        return bool(rng.integers(0, 2))
    if base.startswith("float"):
        return float(np.dtype(base).type(rng.normal()))
    minimum, maximum = INTEGER_RANGES["int8" if base == "byte" else base]
    return int(rng.integers(minimum, maximum, endpoint=True, dtype=DTYPES[base]))


def assert_same(
    got: Any, want: Any, msgtype: str, *, except_for: frozenset[str] = frozenset()
) -> None:
    assert type(got) is type(want)
    for field, described in typestore().fielddefs[msgtype][1]:
        if f"{msgtype}.{field}" in except_for:
            continue
        name = normalize_fieldname(field)
        _same(getattr(got, name), getattr(want, name), described, except_for)


def _same(got: Any, want: Any, described: Any, except_for: frozenset[str]) -> None:
    kind, detail = described
    if kind == Nodetype.NAME:
        assert_same(got, want, detail, except_for=except_for)
    elif kind == Nodetype.BASE:
        assert got == want
        assert type(got) is type(want)
    elif isinstance(want, np.ndarray):
        assert got.dtype == want.dtype
        assert not got.flags.writeable
        assert got.flags.aligned
        np.testing.assert_array_equal(got, want)
    else:
        assert len(got) == len(want)
        for one, other in zip(got, want, strict=True):
            _same(one, other, detail[0], except_for)
