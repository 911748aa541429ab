"""Converts profiles to quality of service as rmw_cyclonedds sets it."""

from __future__ import annotations

from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.util import duration

from volery.bridges.ros2.middleware import Profile

_FOREVER = duration(infinite=True)
_UNLIMITED = -1
_SAMPLES_KEPT = 10_000
"""Largest number of latched samples in all."""


def qos_of(profile: Profile, user_data: bytes = b"") -> Qos:
    """Returns the policies of a reader or writer.

    History is keep-last, so that a writer never waits.
    """
    history = Policy.History.KeepLast(profile.depth)
    policies: list[Any] = [
        Policy.Reliability.Reliable(_FOREVER)
        if profile.reliable
        else Policy.Reliability.BestEffort,
        history,
        Policy.Durability.TransientLocal if profile.latched else Policy.Durability.Volatile,
        Policy.WriterDataLifecycle(autodispose=False),
        Policy.IgnoreLocal.Participant,
    ]
    if profile.latched:
        policies.append(Policy.DurabilityService(0, history, _SAMPLES_KEPT, _UNLIMITED, _UNLIMITED))
    if user_data:
        policies.append(Policy.Userdata(data=user_data))
    return Qos(*policies)
