"""Formulas of signal temporal logic over the flight of a UAV.

A formula is written as a Python expression, of which only a part is allowed:

    always(f, a, b)      f holds at all times from a to b s after now; without a and b, to the end
    eventually(f, a, b)  f holds at one of them
    until(f, g, a, b)    g holds at one of them, and f from now until then
    and, or, not, implies(f, g)
    x > 2, 1 < z <= 3    comparisons of signals, numbers, + - * /, abs, min, max

O. Maler and D. Nickovic, Monitoring temporal properties of continuous signals, FORMATS 2004.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

from volery.core.near_names import near_miss

SIGNALS = (
    *("x", "y", "z"),
    *("vx", "vy", "vz"),
    *("speed", "battery", "tilt_deg"),
    *("separation", "t"),
)
"""Signals of a UAV: position, m, velocity, m/s, in the map; speed, m/s; remaining fraction of the
battery; tilt, deg; distance to the nearest other UAV, m; simulated time, s."""
_OTHER_NAMES = {
    **dict.fromkeys(("altitude", "alt", "height", "z_m"), "z"),
    **dict.fromkeys(("velocity", "v"), "speed"),
    **dict.fromkeys(("time", "time_s"), "t"),
    "charge": "battery",
}
"""Names by which others know signals."""
_TEMPORAL = {"always": 1, "eventually": 1, "until": 2}
_FUNCTIONS = {"abs": 1, "min": 2, "max": 2}
_MAX_NODES = 500


@dataclass(frozen=True)
class Number:
    """A constant."""

    value: float
    """Its value."""


@dataclass(frozen=True)
class Signal:
    """A signal."""

    name: str
    """One of `SIGNALS`."""


@dataclass(frozen=True)
class Arithmetic:
    """An operation on terms: `+`, `-`, `*`, `/`, `abs`, `min` or `max`."""

    operator: str
    """The operation."""
    terms: tuple[Term, ...]
    """Its operands."""


@dataclass(frozen=True)
class Comparison:
    """Compares two terms; the robustness is how far they are from equal."""

    left: Term
    """The greater one."""
    right: Term
    """The smaller one."""
    text: str
    """The comparison as it was written."""
    is_equality: bool = False
    """Whether they must be equal; the robustness is then at most 0."""


@dataclass(frozen=True)
class Connective:
    """`not`, `and` or `or`."""

    operator: str
    """The operation."""
    parts: tuple[Formula, ...]
    """Its operands."""


@dataclass(frozen=True)
class Temporal:
    """`always`, `eventually` or `until`."""

    operator: str
    """The operation."""
    parts: tuple[Formula, ...]
    """One formula; of `until`, two."""
    interval_s: tuple[float, float]
    """First and last time after now, s; inf: to the end."""


Term: TypeAlias = Number | Signal | Arithmetic
Formula: TypeAlias = Comparison | Connective | Temporal


def parse_formula(text: str) -> Formula:
    """Returns a formula. Raises `ValueError`, saying what is wrong, for another text."""
    line = " ".join(text.split())
    try:
        tree = ast.parse(line, mode="eval")
    except (RecursionError, MemoryError):
        raise ValueError("the formula is nested too deeply") from None
    except SyntaxError as error:
        rest = line[max(0, (error.offset or 1) - 1) :][:30]
        where = f"at '{rest}'" if rest else "at its end"
        raise ValueError(f"the formula cannot be read {where}: {error.msg}") from None
    if sum(1 for _ in ast.walk(tree)) > _MAX_NODES:
        raise ValueError("the formula is too long")
    return _formula(tree.body)


def is_invariant(formula: Formula) -> bool:
    """Returns whether a failure is final: the formula always holds, or holds at the beginning."""
    if isinstance(formula, Connective) and formula.operator == "and":
        return all(is_invariant(part) for part in formula.parts)
    if isinstance(formula, Temporal):
        return formula.operator == "always" and not _is_temporal(formula.parts[0])
    return not _is_temporal(formula)


def _is_temporal(formula: Formula) -> bool:
    if isinstance(formula, Comparison):
        return False
    return isinstance(formula, Temporal) or any(_is_temporal(part) for part in formula.parts)


def _formula(node: ast.expr) -> Formula:
    match node:
        case ast.BoolOp(op=op, values=values):
            word = "and" if isinstance(op, ast.And) else "or"
            return Connective(word, tuple(_formula(value) for value in values))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return Connective("not", (_formula(operand),))
        case ast.Compare(left=left, ops=ops, comparators=others):
            return _comparison(left, ops, others)
        case ast.Call(func=ast.Name(id="implies"), args=[one, other], keywords=[]):
            return Connective("or", (Connective("not", (_formula(one),)), _formula(other)))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _TEMPORAL:
            return _temporal(name, arguments)
    raise ValueError(
        f"'{ast.unparse(node)[:80]}' is no formula: compare signals ({', '.join(SIGNALS)}), and "
        "combine comparisons with and, or, not, implies, always, eventually and until"
    )


def _temporal(name: str, arguments: Sequence[ast.expr]) -> Temporal:
    count = _TEMPORAL[name]
    if len(arguments) not in (count, count + 2):
        shape = "f, g, a, b" if count == 2 else "f, a, b"
        raise ValueError(f"{name}: write {name}({shape}), or leave the times a and b out")
    interval = (0.0, math.inf)
    if len(arguments) == count + 2:
        interval = (_seconds(name, arguments[count]), _seconds(name, arguments[count + 1]))
        if interval[0] > interval[1]:
            raise ValueError(f"{name}: {interval[0]:g} s is after {interval[1]:g} s")
    return Temporal(name, tuple(_formula(each) for each in arguments[:count]), interval)


def _seconds(name: str, node: ast.expr) -> float:
    value = node.value if isinstance(node, ast.Constant) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= 1e8:
        raise ValueError(f"{name}: times are numbers of at least 0, not '{ast.unparse(node)[:40]}'")
    return float(value)


def _comparison(left: ast.expr, ops: Sequence[ast.cmpop], others: Sequence[ast.expr]) -> Formula:
    nodes = [left, *others]
    found: list[Formula] = []
    for one, op, other in zip(nodes[:-1], ops, nodes[1:], strict=True):
        first, second = _term(one), _term(other)
        text = ast.unparse(ast.Compare(one, [op], [other]))
        match op:
            case ast.Gt() | ast.GtE():
                found.append(Comparison(first, second, text))
            case ast.Lt() | ast.LtE():
                found.append(Comparison(second, first, text))
            case ast.Eq():
                found.append(Comparison(first, second, text, is_equality=True))
            case _:
                raise ValueError("compare with <, <=, >, >= or ==")
    return found[0] if len(found) == 1 else Connective("and", tuple(found))


def _term(node: ast.expr) -> Term:
    match node:
        case ast.Constant(value=bool()):
            pass
        case ast.Constant(value=int() | float() as value) if math.isfinite(value):
            return Number(float(value))
        case ast.Name(id=name) if name in SIGNALS:
            return Signal(name)
        case ast.Name(id=name):
            hint = near_miss(_OTHER_NAMES.get(name.lower(), name), SIGNALS)
            raise ValueError(f"no signal '{name}'{hint} Known: {', '.join(SIGNALS)}")
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return Arithmetic("-", (Number(0.0), _term(operand)))
        case ast.BinOp(left=left, op=op, right=right):
            signs = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
            if type(op) in signs:
                return Arithmetic(signs[type(op)], (_term(left), _term(right)))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _FUNCTIONS:
            if len(arguments) >= _FUNCTIONS[name] and (name != "abs" or len(arguments) == 1):
                return Arithmetic(name, tuple(_term(each) for each in arguments))
    raise ValueError(
        f"'{ast.unparse(node)[:80]}' is no term: use signals, numbers, + - * /, abs, min and max"
    )
