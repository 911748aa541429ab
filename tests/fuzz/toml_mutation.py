"""TOML files with a few changes: in numbers, keys, structure and bytes."""

from __future__ import annotations

import json
import re
import tomllib

_NUMBER = re.compile(r"(?<![\w.\"'])-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.\"'])")
_FACTORS = (-1.0, 0.0, 0.5, 2.0, 10.0, 0.1, 100.0, 1e3, 1e-3, 1e6, 1e-6, 1e12, 1e-12)
_EXTREMES = (
    *("0", "-0.0", "1e308", "-1e308", "1e-308", "5e-324", "nan", "inf", "-inf", "1", "-1"),
    *("9223372036854775807", "-9223372036854775808", "1" + "0" * 400, "true", '""', "[]", "{}"),
    *("[1.0]", "[nan, 0.0, 0.0]", "1979-05-27", "07:32:00", "0x7fffffff", "0.1", "3.5", "65536"),
)


def changed_text(mutator, text):
    """A TOML text, changed in some of its numbers, its structure or its bytes."""
    fate = mutator.random.random()
    if fate < 0.55:
        for _ in range(mutator.pick((1, 1, 1, 2, 3, 6))):
            text = _other_number(mutator, text)
        return text
    if fate < 0.8:
        return toml_of(mutator.changed(tomllib.loads(text)))
    if fate < 0.9:
        return _other_lines(mutator, text)
    return mutator.bytes([text.encode()]).decode("utf-8", "surrogateescape")


def write(path, text):
    """Write what `changed_text` made, bytes that are no text included."""
    path.write_bytes(text.encode("utf-8", "surrogateescape"))


def _other_number(mutator, text):
    matches = list(_NUMBER.finditer(text))
    if not matches:
        return text
    match = mutator.pick(matches)
    if mutator.chance(0.35):
        number = mutator.pick(_EXTREMES)
    else:
        number = repr(float(match.group()) * mutator.pick(_FACTORS))
    return text[: match.start()] + number + text[match.end() :]


def _other_lines(mutator, text):
    lines = text.splitlines()
    at = mutator.random.randrange(len(lines))
    fate = mutator.random.random()
    if fate < 0.4:
        del lines[at]
    elif fate < 0.7:
        lines.insert(at, lines[mutator.random.randrange(len(lines))])
    else:
        other = mutator.random.randrange(len(lines))
        lines[at], lines[other] = lines[other], lines[at]
    return "\n".join(lines) + "\n"


def toml_of(data):
    """Plain data as TOML, in inline tables; what TOML cannot hold becomes a text."""
    return "".join(f"{json.dumps(str(key))} = {_value(item)}\n" for key, item in data.items())


def _value(value):
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value)  # inf and nan are TOML's words, too
    if isinstance(value, int):
        return str(value)
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, dict):
        inner = ", ".join(f"{json.dumps(str(k))} = {_value(v)}" for k, v in value.items())
        return f"{{{inner}}}"
    return json.dumps(str(value))
