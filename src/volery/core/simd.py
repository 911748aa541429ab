"""Provides SIMD operations on two numbers, for kernels in which LLVM does not find them.

LLVM vectorizes a loop only if it may reorder its sums and knows that outputs do not alias inputs.
Records of states and tables allow neither, so kernels use these operations explicitly:

    w = lanes_at(body.rotor_speed, first)    # elements first and first + 1
    thrust = constant * w * w                # + - * with lanes or a number, element by element
    a, b = totals(thrust, thrust * px)       # the sum of the elements of each

Arrays that are read or written this way have an even length. Products and sums contract as in
the surrounding kernel.
"""

# ruff: noqa: ARG001  numba passes the types of all arguments

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba.core import cgutils
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

LANES = 2
"""Numbers in a register of 128 bits, which every CPU has. Many server CPUs lower their clock for
wider ones: four lanes made everything else on a Cascade Lake an eighth slower."""

# numba's functions have no type annotations
_TYPES: Any = numba.types
_CGUTILS: Any = cgutils
_LOWER: Any = lower_builtin
_TEACH: Any = infer_global
_SIGNATURE: Any = signature
_FLOAT, _INDEX = _TYPES.float64, _TYPES.intp
_NUMBER = ir.DoubleType()
_VECTOR = ir.VectorType(_NUMBER, LANES)
_INDEX_TYPE = ir.IntType(32)


class _LanesType(_TYPES.Type):  # type: ignore[misc]
    """The numba type of a register of numbers."""

    def __init__(self) -> None:
        super().__init__("lanes")


_LANES = _LanesType()


@register_model(_LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)  # type: ignore[no-untyped-call]


def _word(function: Callable[..., Any]) -> Any:
    """Makes `function` an intrinsic for kernels, which pass all its arguments but the first."""
    return intrinsic(function)


def _shuffled(builder: Any, a: Any, b: Any, order: tuple[int, ...]) -> Any:
    mask = ir.Constant(ir.VectorType(_INDEX_TYPE, len(order)), list(order))
    return builder.shuffle_vector(a, b, mask)


def _spread(builder: Any, value: Any, kind: Any) -> Any:
    """Returns a number in all lanes; returns lanes unchanged."""
    if kind == _LANES:
        return value
    nothing = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(nothing, value, ir.Constant(_INDEX_TYPE, 0))
    return _shuffled(builder, first, nothing, (0,) * LANES)


def _teach(operation: Any, instruction: str) -> None:
    """Registers `operation` for lanes and numbers."""
    pairs = ((_LANES, _LANES), (_LANES, _FLOAT), (_FLOAT, _LANES))

    @_TEACH(operation)
    class Template(ConcreteTemplate):
        cases = [_SIGNATURE(_LANES, *pair) for pair in pairs]  # noqa: RUF012

    def generate(_context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        a, b = (_spread(builder, *one) for one in zip(arguments, sig.args, strict=True))
        return getattr(builder, instruction)(a, b)

    for pair in pairs:
        _LOWER(operation, *pair)(generate)


for _operation, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
):
    _teach(_operation, _instruction)
    _teach(getattr(operator, f"i{_operation.__name__}"), _instruction)


def _address_of(context: Any, builder: Any, kind: Any, array: Any, first: Any) -> Any:
    view = _CGUTILS.create_struct_proxy(kind)(context, builder, array)
    return builder.bitcast(builder.gep(view.data, [first]), _VECTOR.as_pointer())


@_word
def lanes_at(_typing: Any, array: Any, first: Any) -> Any:
    """Returns elements of a contiguous float64 array, from index `first`."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return builder.load(_address_of(context, builder, sig.args[0], *arguments), align=8)

    return _LANES(array, _INDEX), generate


@_word
def put_lanes(_typing: Any, array: Any, first: Any, lanes: Any) -> Any:
    """Writes elements of a contiguous float64 array, from index `first`."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        array, first, lanes = arguments
        builder.store(lanes, _address_of(context, builder, sig.args[0], array, first), align=8)
        return context.get_dummy_value()

    return _TYPES.void(array, _INDEX, _LANES), generate


@_word
def no_lanes(_typing: Any) -> Any:
    """Returns zeros."""

    def generate(_context: Any, _builder: Any, _sig: Any, _arguments: Any) -> Any:
        return ir.Constant(_VECTOR, [0.0] * LANES)

    return _LANES(), generate


def _of_each(name: str) -> Callable[..., Any]:
    """Returns the generator of an LLVM intrinsic, applied to each lane."""

    def generate(_context: Any, builder: Any, _sig: Any, arguments: Any) -> Any:
        kind = ir.FunctionType(_VECTOR, [_VECTOR])
        function = _CGUTILS.get_or_insert_function(builder.module, kind, f"{name}.v{LANES}f64")
        return builder.call(function, arguments)

    return generate


@_word
def roots(_typing: Any, lanes: Any) -> Any:
    """Returns the square roots."""
    return _LANES(_LANES), _of_each("llvm.sqrt")


@_word
def magnitudes(_typing: Any, lanes: Any) -> Any:
    """Returns the absolute values."""
    return _LANES(_LANES), _of_each("llvm.fabs")


@_word
def not_negative(_typing: Any, lanes: Any) -> Any:
    """Returns each number, or zero where the number is negative."""

    def generate(_context: Any, builder: Any, _sig: Any, arguments: Any) -> Any:
        zero = ir.Constant(_VECTOR, [0.0] * LANES)
        return builder.select(builder.fcmp_ordered(">", arguments[0], zero), arguments[0], zero)

    return _LANES(_LANES), generate


@_word
def where_negative(_typing: Any, lanes: Any, then: Any, other: Any) -> Any:
    """Returns elements of `then` where `lanes` are below zero, else of `other`."""

    def generate(_context: Any, builder: Any, _sig: Any, arguments: Any) -> Any:
        lanes, then, other = arguments
        zero = ir.Constant(_VECTOR, [0.0] * LANES)
        return builder.select(builder.fcmp_ordered("<", lanes, zero), then, other)

    return _LANES(_LANES, _LANES, _LANES), generate


@_word
def any_outside(_typing: Any, lanes: Any, low: Any, high: Any) -> Any:
    """Returns whether any number is below `low` (lanes) or above `high` (one number).

    NaN counts as outside.
    """

    def generate(_context: Any, builder: Any, _sig: Any, arguments: Any) -> Any:
        lanes, low, high = arguments
        below = builder.fcmp_unordered("<", lanes, low)
        above = builder.fcmp_unordered(">", lanes, _spread(builder, high, _FLOAT))
        bits = builder.bitcast(builder.or_(below, above), ir.IntType(LANES))
        return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    return _TYPES.boolean(_LANES, _LANES, _FLOAT), generate


@_word
def totals(_typing: Any, a: Any, b: Any) -> Any:
    """Returns the sums (a, b) over the lanes."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        a, b = arguments
        left, right = (_shuffled(builder, a, b, order) for order in ((0, 2), (1, 3)))
        sums = builder.fadd(left, right)
        numbers = [builder.extract_element(sums, ir.Constant(_INDEX_TYPE, k)) for k in range(2)]
        return context.make_tuple(builder, sig.return_type, numbers)

    return _TYPES.UniTuple(_FLOAT, 2)(_LANES, _LANES), generate
