"""Lists the peers, their pinned versions and their contests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

RATE_HZ = 500
"""Rate of physics and of the innermost control layer in simulated time, Hz."""


@dataclass(frozen=True)
class RayContest:
    """Casts beams of `uavs` UAVs with two LIDARs into a piece of forest, one UAV per call."""

    uavs: int = 20
    unit: ClassVar[str] = "rays"

    @property
    def case(self) -> str:
        """Name of the contest within the peer."""
        return "forest"

    def __str__(self) -> str:
        return "rays a second in a forest"


@dataclass(frozen=True)
class HoverContest:
    """Holds UAVs at their positions at `RATE_HZ`: `drones` in each of `worlds`."""

    drones: int
    worlds: int
    steps: int
    """Number of physics steps of the peer in a round."""
    unit: ClassVar[str] = "steps"

    @property
    def vehicles(self) -> int:
        """Number of UAVs in all worlds."""
        return self.drones * self.worlds

    @property
    def case(self) -> str:
        """Name of the contest within the peer."""
        return f"{self.drones}_drones" if self.worlds == 1 else f"{self.worlds}_worlds"

    def __str__(self) -> str:
        if self.worlds == 1:
            return f"drone-steps a second, {self.drones} drones in one world"
        return f"drone-steps a second, {self.worlds:,} worlds of one drone"


Contest = RayContest | HoverContest


@dataclass(frozen=True)
class Peer:
    """Describes another simulator.

    `requirements`: pinned packages that pip installs, the peer itself first. `script`: file of
    this folder that drives the peer.
    """

    name: str
    requirements: tuple[str, ...]
    script: str
    contests: tuple[Contest, ...]

    @property
    def packages(self) -> tuple[str, ...]:
        """Names of the requirements."""
        return tuple(requirement.partition("==")[0] for requirement in self.requirements)

    def figure(self, contest: Contest, what: str) -> str:
        """Returns the name of a figure of one of the peer's contests."""
        return f"{self.name}_{contest.case}_{what}"


PEERS = (
    Peer(
        "pybullet",
        # its wheel is built against numpy 1
        ("pybullet==3.2.7", "numpy==1.26.4"),
        "pybullet_rays.py",
        (RayContest(),),
    ),
    Peer("open3d", ("open3d==0.20.0", "numpy==2.4.6"), "open3d_rays.py", (RayContest(),)),
    Peer(
        "pyflyt",
        ("PyFlyt==0.29.0", "pybullet==3.2.7", "numpy==1.26.4", "numba==0.68.1"),
        "pyflyt_hover.py",
        (HoverContest(drones=100, worlds=1, steps=20),),
    ),
    Peer(
        "crazyflow",
        (
            "crazyflow==0.4.0",
            "jax==0.10.1",
            "jaxlib==0.10.1",
            "mujoco==4.0.0",
            "mujoco-mjx==3.17.0",
            "numpy==2.4.6",
        ),
        "crazyflow_hover.py",
        (
            HoverContest(drones=100, worlds=1, steps=500),
            HoverContest(drones=1, worlds=1_024, steps=500),
            HoverContest(drones=1, worlds=10_000, steps=100),
        ),
    ),
)
