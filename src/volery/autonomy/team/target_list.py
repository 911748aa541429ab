"""The detections of all UAVs, and their grouping into targets."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from volery.core.clock import NS_PER_S
from volery.graph.messages import Point, header, message_type, stamp_of

TYPE = "volery_interfaces/msg/Target"
_NUM_REPORTED = 2
"""Number of newest detections, and of others, in a report. Modelling choice."""
_END_NS = 2**31 * NS_PER_S
"""End of what `builtin_interfaces/Time` can hold; a large `nanosec` can carry a stamp beyond it."""
_MIN_M = 0.1
"""Smallest standard deviation of a position: maps of two UAVs differ. Modelling choice."""


class Detection(NamedTuple):
    """A target as one UAV observed it."""

    finder: str
    number: int
    stamp_ns: int
    position: tuple[float, float, float]
    """(3,) m, map."""
    covariance: tuple[float, float, float, float]
    """(2, 2) of x and y, row by row, m^2."""
    sightings: int

    @classmethod
    def from_message(cls, message: Any) -> Detection:
        """Returns the detection of a `Target` message."""
        p = message.position
        a, b, c, d = map(float, message.covariance)
        return cls(
            message.finder,
            int(message.number),
            stamp_of(message),
            (p.x, p.y, p.z),
            (a, b, c, d),
            int(message.sightings),
        )

    @property
    def is_sound(self) -> bool:
        """Whether the values are finite, the stamp can be sent and the covariance is valid."""
        if not 0 <= self.stamp_ns < _END_NS:
            return False
        a, b, c, d = self.covariance
        finite = bool(np.isfinite([*self.position, *self.covariance]).all())
        return finite and a >= 0.0 and d >= 0.0 and a * d >= b * c

    def message(self) -> Any:
        """Returns the detection as a `Target` message."""
        return message_type(TYPE)(
            header(self.stamp_ns, "map"),
            self.finder,
            self.number,
            Point(*self.position),
            np.array(self.covariance),
            self.sightings,
        )


@dataclass
class TargetList:
    """Detections by finder and number; the newest of each counts, in any order of arrival.

    gate_m: detections nearer to each other than this are of one target.
    """

    gate_m: float
    detections: dict[tuple[str, int], Detection] = field(default_factory=dict)

    def take(self, detections: Iterable[Detection]) -> bool:
        """Adds detections; returns whether one of them was new."""
        changed = False
        for detection in detections:
            if not detection.is_sound:
                continue
            key = detection.finder, detection.number
            if key not in self.detections or self.detections[key].stamp_ns < detection.stamp_ns:
                self.detections[key], changed = detection, True
        return changed

    def changed(self, turn: int) -> list[Any]:
        """Returns some detections as messages: the newest ones, and others in turn.

        A report with all of them would fill the radio's channel; after some turns all have been
        sent.
        """
        keys = sorted(self.detections, key=lambda key: (-self.detections[key].stamp_ns, key))
        newest, others = keys[:_NUM_REPORTED], sorted(keys[_NUM_REPORTED:])
        first = turn * _NUM_REPORTED % max(len(others), 1)
        in_turn = (others[first:] + others[:first])[:_NUM_REPORTED]
        return [self.detections[key].message() for key in (*newest, *in_turn)]

    def targets(self) -> list[Detection]:
        """Returns one detection for each target, fused by their covariances."""
        groups: list[list[Detection]] = []
        for key in sorted(self.detections):
            detection = self.detections[key]
            for group in groups:
                if (
                    np.hypot(*np.subtract(detection.position[:2], group[0].position[:2]))
                    <= self.gate_m
                ):
                    group.append(detection)
                    break
            else:
                groups.append([detection])
        return [_joined(group) for group in groups]


def _joined(group: list[Detection]) -> Detection:
    """Returns one detection fused from several of the same target, with the first one's name."""
    if len(group) == 1:
        return group[0]
    information, weighted, height = np.zeros((2, 2)), np.zeros(2), 0.0
    for detection in group:
        weight = np.linalg.inv(np.reshape(detection.covariance, (2, 2)) + _MIN_M**2 * np.eye(2))
        information += weight
        weighted += weight @ detection.position[:2]
        height += detection.position[2] / len(group)
    covariance = np.linalg.inv(information)
    x, y = covariance @ weighted
    a, b, c, d = covariance.ravel().tolist()
    return group[0]._replace(
        stamp_ns=max(detection.stamp_ns for detection in group),
        position=(float(x), float(y), float(height)),
        covariance=(a, b, c, d),
        sightings=sum(detection.sightings for detection in group),
    )
