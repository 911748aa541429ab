"""Valid frames and values made invalid by a few changes, so that they get deep into a parser."""

from __future__ import annotations

import struct

LENGTHS = (0, 1, 2, 3, 4, 5, 7, 8, 16, 255, 256, 4096, 65535, 65536, 1 << 20, 1 << 26, 1 << 31)
_NUMBERS = (*LENGTHS, *((1 << bits) - 1 for bits in (7, 15, 31, 32, 63, 64)))
_FORMS = ("<B", "<H", "<I", "<Q", ">H", ">I", ">Q")
_SCALARS = (
    *(None, True, False, 0, 1, -1, 2, 7, 255, 256, -129, 1 << 31, 1 << 32, 1 << 63, 10**30),
    *(0.0, -0.0, 0.5, -1.5, 1e300, 1e-320, 3.5e38, float("nan"), float("inf"), -float("inf")),
    *("", "a", "/", "/a", "/b", "a b", "/a//b", "/ü", "__x", "none", "png", "cbor", "cbor-raw"),
    *("x" * 300, "\0", "\ud800", "🚁", "AA==", "A", "nan", "NaN", "1", "true", "AAECAwQFBgc="),
    *("std_msgs/String", "std_msgs/msg/String", "std_srvs/srv/Trigger", "std_srvs/Trigger"),
    *("no_pkg/Nothing", "Header", "time", "geometry_msgs/Twist", "a/b/c/d", "../x", "std_msgs/"),
)  # fmt: skip


class Mutator:
    """Changes made as a `random.Random` draws them; the same draws make the same changes."""

    def __init__(self, random):
        self.random = random

    def pick(self, options):
        return options[self.random.randrange(len(options))]

    def chance(self, probability):
        return self.random.random() < probability

    def cut(self, data):
        """The same bytes in pieces."""
        if self.chance(0.5):
            return [data]
        cuts = sorted(self.random.randrange(len(data) + 1) for _ in range(3))
        return [data[a:b] for a, b in zip([0, *cuts], [*cuts, len(data)], strict=True)]

    # ------------------------------------------------------------------------------------ bytes

    def noise(self, max_bytes):
        return self.random.getrandbits(8 * max_bytes).to_bytes(max_bytes)[
            : self.random.randrange(max_bytes + 1)
        ]

    def bytes(self, seeds):
        """One of the seeds: now and then as it is, mostly changed, rarely nothing but noise."""
        fate = self.random.random()
        if fate < 0.03:
            return self.noise(64)
        data = bytearray(self.pick(seeds))
        if fate < 0.08:
            return bytes(data)
        for _ in range(self.pick((1, 1, 1, 1, 2, 2, 3, 5))):
            self.pick(_EDITS)(self, data, seeds)
        return bytes(data)

    def _index(self, data):
        return self.random.randrange(len(data) + 1)

    def _flip(self, data, _seeds):
        if data:
            data[self._index(data) - 1] ^= 1 << self.random.randrange(8)

    def _set(self, data, _seeds):
        if data:
            data[self._index(data) - 1] = self.random.randrange(256)

    def _number(self, data, _seeds):
        form = self.pick(_FORMS)
        size = struct.calcsize(form)
        number = self.pick(_NUMBERS) + self.random.randrange(-1, 2)
        at = self._index(data)
        data[at : at + size] = struct.pack(form, number % (1 << 8 * size))

    def _insert(self, data, _seeds):
        at = self._index(data)
        data[at:at] = self.noise(12)

    def _remove(self, data, _seeds):
        at = self._index(data)
        del data[at : at + self.random.randrange(1, 12)]

    def _repeat(self, data, _seeds):
        at = self._index(data)
        data[at:at] = data[at : at + self.random.randrange(1, 40)] * self.random.randrange(1, 4)

    def _splice(self, data, seeds):
        other = self.pick(seeds)
        at = self._index(data)
        data[at:] = other[self._index(other) :]

    def _truncate(self, data, _seeds):
        del data[self._index(data) :]

    # ------------------------------------------------------------------------------ plain values

    def plain(self, value, changes=None):
        """Dicts, lists and scalars like `value`, changed at a few positions; `value` stays."""
        for _ in range(self.random.randrange(4) if changes is None else changes):
            value = self._changed(value, 0)
        return value

    def changed(self, fields):
        """Like `plain`, and a dict still."""
        changed = self.plain(fields)
        return changed if isinstance(changed, dict) else fields

    def scalar(self):
        return self.pick(_SCALARS)

    def _changed(self, value, depth):
        inside = isinstance(value, (dict, list)) and value and depth < 20
        if not inside or self.chance(0.1):
            return self._replaced(value)
        copy = value.copy()
        if isinstance(copy, dict):
            key = self.pick(list(copy))
            fate = self.random.random()
            if fate < 0.12:
                del copy[key]
            elif fate < 0.2:
                copy[str(self.scalar())] = copy[key]
            else:
                copy[key] = self._changed(copy[key], depth + 1)
            return copy
        at = self.random.randrange(len(copy))
        fate = self.random.random()
        if fate < 0.1:
            del copy[at]
        elif fate < 0.2:
            copy[at:at] = [copy[at]] * self.random.randrange(1, 40)
        else:
            copy[at] = self._changed(copy[at], depth + 1)
        return copy

    def _replaced(self, value):
        fate = self.random.random()
        if fate < 0.1:
            return [value]
        if fate < 0.15:
            return {"data": value}
        if fate < 0.2:
            return self.pick(([], {}, [0] * 9, ["x"], [[]], b"", b"\1\2", [1.5, float("nan")]))
        if fate < 0.3 and isinstance(value, str):
            return value[: self.random.randrange(len(value) + 1)] + str(self.scalar())
        if fate < 0.4 and isinstance(value, int):
            return value + self.random.randrange(-2, 3)
        return self.scalar()


_EDITS = (
    Mutator._flip,
    Mutator._set,
    Mutator._number,
    Mutator._number,
    Mutator._insert,
    Mutator._remove,
    Mutator._repeat,
    Mutator._splice,
    Mutator._truncate,
)
