"""Two numbers in one register: SIMD words for kernels, where a compiler would not find them.

LLVM turns a loop into SIMD code only where it may reorder its sums and knows that what it writes
is not what it reads. Records of states and tables allow neither, so kernels say it themselves:

    w = lanes_at(body.rotor_speed, first)    # elements first and first + 1
    thrust = constant * w * w                # + - * with lanes or a number, element by element
    a, b = totals(thrust, thrust * px)       # the sum of each one's elements

Arrays that are read or written so have an even length. Products and sums contract where those of
the kernel around do.
"""

# ruff: noqa: ARG001  numba gives the types of all arguments to whoever asks for one

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
"""Numbers in a register of 128 bits, which every CPU has. For arithmetic in wider ones many server
CPUs lower their clock: four lanes made all else on a Cascade Lake an eighth slower."""

# numba's own words have no types
_TYPES: Any = numba.types
_CGUTILS: Any = cgutils
_LOWER: Any = lower_builtin
_TEACH: Any = infer_global
_SIGNATURE: Any = signature
_FLOAT, _INDEX = _TYPES.float64, _TYPES.intp
_NUMBER = ir.DoubleType()
_VECTOR = ir.VectorType(_NUMBER, LANES)
_PLACE = ir.IntType(32)


class _LanesType(_TYPES.Type):  # type: ignore[misc]
    """numba's type of a register of numbers."""

    def __init__(self) -> None:
        super().__init__("lanes")


_LANES = _LanesType()


@register_model(_LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)  # type: ignore[no-untyped-call]


def _word(function: Callable[..., Any]) -> Any:
    """Let kernels call what `function` tells of. They give all its arguments but the first."""
    return intrinsic(function)


def _shuffled(builder: Any, a: Any, b: Any, order: tuple[int, ...]) -> Any:
    mask = ir.Constant(ir.VectorType(_PLACE, len(order)), list(order))
    return builder.shuffle_vector(a, b, mask)


def _spread(builder: Any, value: Any, kind: Any) -> Any:
    """A number in all lanes; lanes as they are."""
    if kind == _LANES:
        return value
    nothing = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(nothing, value, ir.Constant(_PLACE, 0))
    return _shuffled(builder, first, nothing, (0,) * LANES)


def _teach(operation: Any, instruction: str) -> None:
    """Let `operation` work on lanes and numbers."""
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


def _place_of(context: Any, builder: Any, kind: Any, array: Any, first: Any) -> Any:
    view = _CGUTILS.create_struct_proxy(kind)(context, builder, array)
    return builder.bitcast(builder.gep(view.data, [first]), _VECTOR.as_pointer())


@_word
def lanes_at(_typing: Any, array: Any, first: Any) -> Any:
    """Elements of a contiguous float64 array, from number `first` on."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        return builder.load(_place_of(context, builder, sig.args[0], *arguments), align=8)

    return _LANES(array, _INDEX), generate


@_word
def put_lanes(_typing: Any, array: Any, first: Any, lanes: Any) -> Any:
    """Write elements of a contiguous float64 array, from number `first` on."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        array, first, lanes = arguments
        builder.store(lanes, _place_of(context, builder, sig.args[0], array, first), align=8)
        return context.get_dummy_value()

    return _TYPES.void(array, _INDEX, _LANES), generate


@_word
def no_lanes(_typing: Any) -> Any:
    """Zeros."""

    def generate(_context: Any, _builder: Any, _sig: Any, _arguments: Any) -> Any:
        return ir.Constant(_VECTOR, [0.0] * LANES)

    return _LANES(), generate


def _of_each(name: str) -> Callable[..., Any]:
    """An LLVM intrinsic of one number, for each lane."""

    def generate(_context: Any, builder: Any, _sig: Any, arguments: Any) -> Any:
        kind = ir.FunctionType(_VECTOR, [_VECTOR])
        function = _CGUTILS.get_or_insert_function(builder.module, kind, f"{name}.v{LANES}f64")
        return builder.call(function, arguments)

    return generate


@_word
def roots(_typing: Any, lanes: Any) -> Any:
    """Square roots."""
    return _LANES(_LANES), _of_each("llvm.sqrt")


@_word
def magnitudes(_typing: Any, lanes: Any) -> Any:
    """Absolute values."""
    return _LANES(_LANES), _of_each("llvm.fabs")


@_word
def not_negative(_typing: Any, lanes: Any) -> Any:
    """Each number, or zero where it is below."""

    def generate(_context: Any, builder: Any, _sig: Any, arguments: Any) -> Any:
        zero = ir.Constant(_VECTOR, [0.0] * LANES)
        return builder.select(builder.fcmp_ordered(">", arguments[0], zero), arguments[0], zero)

    return _LANES(_LANES), generate


@_word
def where_negative(_typing: Any, lanes: Any, then: Any, other: Any) -> Any:
    """Elements of `then` where those of `lanes` are below zero, else of `other`."""

    def generate(_context: Any, builder: Any, _sig: Any, arguments: Any) -> Any:
        lanes, then, other = arguments
        zero = ir.Constant(_VECTOR, [0.0] * LANES)
        return builder.select(builder.fcmp_ordered("<", lanes, zero), then, other)

    return _LANES(_LANES, _LANES, _LANES), generate


@_word
def any_outside(_typing: Any, lanes: Any, least: Any, most: Any) -> Any:
    """Whether some number lies below that of `least` (lanes) or above `most` (one number).

    What is not a number counts as outside.
    """

    def generate(_context: Any, builder: Any, _sig: Any, arguments: Any) -> Any:
        lanes, least, most = arguments
        below = builder.fcmp_unordered("<", lanes, least)
        above = builder.fcmp_unordered(">", lanes, _spread(builder, most, _FLOAT))
        bits = builder.bitcast(builder.or_(below, above), ir.IntType(LANES))
        return builder.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    return _TYPES.boolean(_LANES, _LANES, _FLOAT), generate


@_word
def totals(_typing: Any, a: Any, b: Any) -> Any:
    """Sums (a, b) over the lanes."""

    def generate(context: Any, builder: Any, sig: Any, arguments: Any) -> Any:
        a, b = arguments
        left, right = (_shuffled(builder, a, b, order) for order in ((0, 2), (1, 3)))
        sums = builder.fadd(left, right)
        numbers = [builder.extract_element(sums, ir.Constant(_PLACE, k)) for k in range(2)]
        return context.make_tuple(builder, sig.return_type, numbers)

    return _TYPES.UniTuple(_FLOAT, 2)(_LANES, _LANES), generate
