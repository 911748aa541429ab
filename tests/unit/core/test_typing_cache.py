"""Tests that numba infers the same types with the typing cache, with fewer queries."""

import operator
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from numba import njit, types
from numba.core.errors import TypingError

from volery.core import typing_cache
from volery.core.typing_cache import remembered_types

_RESOLVE = types.BaseFunction.get_call_type
_PRODUCT = (operator.mul, (types.float64, types.float64))


def _blend(values, k):
    low, high = values[k], values[k + 1]
    if k > 2:
        low, high = high * 2.0, -low
    return min(low * 0.25 + high * 0.75, low * high), k // 2, low < high


@pytest.fixture
def questions(monkeypatch):
    """What numba's own answers were asked for."""
    asked = []

    def resolve(function, context, arguments, keywords):
        asked.append((function.typing_key, tuple(arguments)))
        return _RESOLVE(function, context, arguments, keywords)

    monkeypatch.setattr(types.BaseFunction, "get_call_type", resolve)
    return asked


def test_a_kernel_gets_the_same_types_and_the_same_code():
    values = np.array([1.0, -4.0, 2.5, 8.0, 3.0])
    plain, quick = njit(_blend), njit(_blend)
    expected = [plain(values, k) for k in range(4)]
    with remembered_types():
        found = [quick(values, k) for k in range(4)]
    assert found == expected
    assert quick.nopython_signatures == plain.nopython_signatures
    (first,), (second,) = plain.overloads.values(), quick.overloads.values()
    assert second.type_annotation.typemap == first.type_annotation.typemap


def test_each_product_is_asked_for_once(questions):
    with remembered_types():
        njit(_blend)(np.ones(4), 1)
    assert questions.count(_PRODUCT) == 1
    njit(_blend)(np.ones(4), 1)
    assert questions.count(_PRODUCT) > 2


def test_what_numba_compiles_for_its_caller_is_not_remembered(questions):
    smaller = (min, (types.float64, types.float64))
    with remembered_types():
        njit(_blend)(np.ones(4), 1)
        after_one = questions.count(smaller)
        njit(_blend, fastmath=True)(np.ones(4), 1)
    assert questions.count(smaller) == 2 * after_one > 0


def test_a_refusal_stays_one():
    with remembered_types():
        for _ in range(2):
            with pytest.raises(TypingError, match="No implementation of function"):
                njit(lambda a: a + None)(1.0)


def test_numba_is_left_as_it_was():
    with remembered_types():
        assert types.BaseFunction.get_call_type is not _RESOLVE
    assert types.BaseFunction.get_call_type is _RESOLVE


@pytest.mark.parametrize("lacks", ["BaseFunction", "Record"])
def test_a_numba_without_these_names_compiles_as_ever(questions, monkeypatch, lacks):
    others = {name: getattr(types, name) for name in ("BaseFunction", "Record") if name != lacks}
    monkeypatch.setattr(typing_cache, "_TYPES", SimpleNamespace(**others))
    with remembered_types():
        assert njit(_blend)(np.ones(4), 1) == (1.0, 0, False)
    assert (questions.count(_PRODUCT) > 2) == (lacks == "BaseFunction")


def test_a_numba_that_asks_in_other_words_is_answered_by_itself(monkeypatch):
    class Function:
        asked = 0

        def get_call_type(self, arguments):
            self.asked += 1
            return arguments

    monkeypatch.setattr(typing_cache, "_TYPES", SimpleNamespace(BaseFunction=Function))
    function = Function()
    with remembered_types():
        assert [function.get_call_type((1, 2)) for _ in range(2)] == 2 * [(1, 2)]
    assert function.asked == 2


def test_records_are_written_out_as_ever():
    kind = numba.from_dtype(np.dtype([("x", "f8"), ("inside", [("k", "i8", 3)])]))
    plain = repr(kind)
    with remembered_types():
        assert [repr(kind), repr(kind)] == [plain, plain]
