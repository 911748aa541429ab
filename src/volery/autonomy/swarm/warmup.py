"""Compiles the kernels of swarms; see `volery.autonomy.perception.warmup`."""

from __future__ import annotations

import numpy as np

from volery.autonomy.perception.scan_points import ScanProjector
from volery.autonomy.perception.warmup import a_pose, a_scan
from volery.autonomy.swarm.ares import AresSettings
from volery.autonomy.swarm.behaviour import Surroundings, flock_within
from volery.autonomy.swarm.formation_fitness import formation_fitness
from volery.autonomy.swarm.formation_search import plan_formation
from volery.autonomy.swarm.joining import trajectory_into
from volery.autonomy.swarm.member_planning import MemberPlanner
from volery.autonomy.swarm.olfati_saber import OlfatiSaber
from volery.autonomy.swarm.orca import Orca
from volery.autonomy.swarm.particle_swarm import FlockLimits, approach_margin
from volery.autonomy.swarm.team_scans import find_nearest
from volery.autonomy.swarm.trajectories import Trajectories
from volery.autonomy.swarm.vasarhelyi import Vasarhelyi


def formation_search() -> None:
    """Compiles the search of a plan, and the fitness of a formation."""
    positions = np.array([[0.0, 0.0], [2.0, 1.0], [4.0, 0.0]])
    velocities = np.full((3, 2), 0.5)
    formation_fitness(positions, velocities)
    plan_formation(positions, velocities, settings=AresSettings(num_clones=1, num_levels=1))
    start, others, trajectory = np.ones(4), np.zeros((2, 2, 1)), np.empty((2, 4))
    trajectory_into(start, start[:2], start[:2], others, FlockLimits(), np.uint64(1), 0, trajectory)
    flock = np.zeros((4, 3))
    approach_margin(flock, flock, 1.0)


def member_planning() -> None:
    """Compiles the planning of a bird that searches, settles and joins."""
    planner = MemberPlanner(FlockLimits(1.0, 3.0, 1.0))
    scattered = np.array([[0.0, 2.0, 4.0], [0.0, 1.0, 0.0], [0.5] * 3, [0.5] * 3])
    formed = np.array([[0.0, 1.9, -1.9], [0.0, -1.0, -1.0], [0.0] * 3, [1.0] * 3])
    for flock, joining in ((scattered, False), (formed, False), (scattered, True)):
        planner.is_joining = joining
        planner.velocity(flock, np.array([joining, False, False]), 0)
    formation_fitness(formed[:2].T, formed[2:].T)


def flocking() -> None:
    """Compiles the behaviours of flocks."""
    position, velocity = np.array([[0.0, 0.0], [2.0, 1.0]]), np.zeros((2, 2))
    ScanProjector([0.0, 0.0, 0.0]).points(a_scan(), a_pose(0))
    find_nearest(np.ones((1, 2)), position, 0, np.full((4, 2), np.nan))
    around = Surroundings(cylinders=np.array([[5.0, 5.0, 0.3]]))
    for behaviour in (Vasarhelyi(), OlfatiSaber(), Orca(), Trajectories()):
        flock = flock_within(position, velocity, behaviour.radius_m)
        behaviour.velocities(flock, velocity, around)
