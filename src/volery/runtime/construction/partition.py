"""The UAVs that this machine serves in a run that is divided among several.

Every machine computes the dynamics of all UAVs and their cheap sensors. The LIDARs, cameras and
nodes of a UAV exist on one machine, the nodes of the whole system on the leader.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Partition:
    """A leader's partition is all UAVs but some, a worker's is some; the default is all UAVs."""

    is_leader: bool = True
    """Whether the machine also runs the nodes of the whole system, and serves new UAVs."""
    named: frozenset[str] = frozenset()
    """UAVs that a worker serves, or that a leader leaves to workers."""

    def serves(self, uav: str) -> bool:
        """Returns whether LIDARs, cameras and nodes of a UAV exist on this machine."""
        return (uav in self.named) != self.is_leader


WHOLE = Partition()
DIVIDED_SENSORS = ("lidar", "camera")
"""Kinds of sensors that one machine samples for all others."""
