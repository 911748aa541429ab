"""Plans a path through the map: OMPL's RRT-Connect over the ground, then shortcuts.

States are (x, y, h): a position and its height above ground, so that paths follow uneven ground. J.
Kuffner, S. LaValle, "RRT-connect: an efficient approach to single-query path planning", ICRA 2000;
I. Sucan, M. Moll, L. Kavraki, "The Open Motion Planning Library", 2012.

The search is bounded by iterations, never by wall time. OMPL seeds the random generators of each
planner from one sequence of the process. Each plan reseeds that sequence and holds a lock until it
is complete, so that a plan depends on its input and its seed only, whatever other threads plan.
"""

from __future__ import annotations

import threading
from typing import Any, NamedTuple

import numpy as np

from volery.autonomy.planning.voxel_space import VoxelSpace
from volery.core.arrays import Array
from volery.core.errors import NodeError, PlanError
from volery.core.extras import import_extra

_OMPL = threading.Lock()


class PathSearch(NamedTuple):
    """Settings of the path search."""

    radius_m: float = 0.8
    """Min distance to obstacles."""
    heights_m: tuple[float, float] = (2.0, 4.5)
    """Min and max height above ground."""
    iterations: int = 4000
    range_m: float = 10.0
    """Longest leg that the search adds at once."""
    straighten: int = 60
    """Attempts to shorten the path."""


def plan_path(
    space: VoxelSpace, start: Array, goal: Array, height_m: float, search: PathSearch, seed: int
) -> Array:
    """Returns positions (K, 3) m from `start` to `goal` (3,), `height_m` above ground at the goal.

    Start and goal are moved, by up to 3 m, if they are too near to obstacles. Raises PlanError if
    one of them is deep inside of obstacles or off the map, or if no path is found within the
    iterations.
    """
    low, high = search.heights_m
    here = float(start[2] - space.ground_at(start[:2]))
    begin = space.free_near(np.array([*start[:2], np.clip(here, low, high)]), search.radius_m)
    end = space.free_near(np.array([*goal[:2], np.clip(height_m, low, high)]), search.radius_m)
    if begin is None:
        raise PlanError(f"the start ({start[0]:.1f}, {start[1]:.1f}) is off the map or blocked")
    if end is None:
        raise PlanError(f"the goal ({goal[0]:.1f}, {goal[1]:.1f}) is off the map or blocked")
    if space.is_free_between(begin, end, search.radius_m):
        states = np.stack([begin, end])
    else:
        with _OMPL:
            states = _search(space, begin, end, search, seed)
    waypoints = np.array(states)
    waypoints[:, 2] += [float(space.ground_at(waypoint[:2])) for waypoint in waypoints]
    return waypoints


def _search(space: VoxelSpace, begin: Array, end: Array, search: PathSearch, seed: int) -> Array:
    """Returns the states (K, 3) of a path, by OMPL. The caller holds `_OMPL`."""
    import_extra("planning", "ompl", "ompl", "autonomy", NodeError)
    from ompl import base, geometric, util

    util.setLogLevel(util.LogLevel.LOG_NONE)
    util.RNG.setSeed(1 + seed % 1_000_000_000)
    states = base.RealVectorStateSpace(3)
    bounds = base.RealVectorBounds(3)
    for axis, (low, high) in enumerate([*space.box(), search.heights_m]):
        bounds.setLow(axis, low)
        bounds.setHigh(axis, high)
    states.setBounds(bounds)
    setup = geometric.SimpleSetup(states)
    information = setup.getSpaceInformation()
    radius = search.radius_m
    setup.setStateValidityChecker(lambda s: space.is_free(s[0], s[1], s[2], radius))

    class CompiledMotionValidator(base.MotionValidator):  # type: ignore[misc]
        """Checks a leg in one compiled call."""

        def checkMotion(self, a: Any, b: Any, *_last: Any) -> bool:  # noqa: N802
            return space.is_free_leg(a[0], a[1], a[2], b[0], b[1], b[2], radius)

    validator = CompiledMotionValidator(information)
    information.setMotionValidator(validator)
    first, last = states.allocState(), states.allocState()
    for axis in range(3):
        first[axis], last[axis] = float(begin[axis]), float(end[axis])
    setup.setStartAndGoalStates(first, last)
    planner = geometric.RRTConnect(information)
    planner.setRange(search.range_m)
    setup.setPlanner(planner)
    asked = [0]

    def spent() -> bool:
        asked[0] += 1
        return asked[0] > search.iterations

    if (
        not setup.solve(base.PlannerTerminationCondition(spent))
        or not setup.haveExactSolutionPath()
    ):
        raise PlanError(f"no path was found in {search.iterations} iterations")
    path = setup.getSolutionPath()
    simplifier = geometric.PathSimplifier(information)
    simplifier.reduceVertices(path, search.straighten)
    simplifier.partialShortcutPath(path, search.straighten, search.straighten)
    simplifier.reduceVertices(path, search.straighten)
    return np.array([[s[0], s[1], s[2]] for s in path.getStates()])
