"""Flies the scenario `forest_search` once and measures the flight."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from volery.core.arrays import Array
from volery.engine.events import EventKind
from volery.graph.messages import Published, stamp_of
from volery.report.logged_flights import TRUTH
from volery.report.trajectories import RecordedTrajectory
from volery.report.trunk_survey import LEVEL, NODDING, TrunkSurvey
from volery.results.alignment import Alignment, at_times, ate_rmse_m, common_times, umeyama
from volery.runtime import Simulation
from volery.scenario import overrides
from volery.scenario.load import load_scenario, parse_scenario
from volery.scenario.schema import Scenario
from volery.verdicts.observing import ESTIMATES

SIGHT_M = 6.0
"""Distance up to which the task manager counts a position as seen, m."""
_CELL_M = 2.0
_POSE_NS = 100_000_000
_TARGET_GATE_M = 4.0


@dataclass
class Flown:
    """Holds the data of one UAV; times are in s."""

    truth: list[tuple[float, ...]] = field(default_factory=list)
    """Time, position (3), attitude (4), from ground truth."""
    estimate: list[tuple[float, ...]] = field(default_factory=list)
    survey: TrunkSurvey = field(default_factory=TrunkSurvey)
    """Scans from which trunks are extracted."""
    targets: list[tuple[float, Array]] = field(default_factory=list)
    """Time and target positions (T, 2) of each published list."""

    @property
    def trajectory(self) -> RecordedTrajectory:
        """True trajectory."""
        return RecordedTrajectory.of_rows(self.truth)

    @property
    def own_trajectory(self) -> RecordedTrajectory:
        """Estimated trajectory."""
        return RecordedTrajectory.of_rows(self.estimate)

    def true_and_own(self) -> tuple[Array, Array]:
        """Returns true and estimated positions (N, 3), m, at the times of the estimates."""
        own, trajectory = self.own_trajectory, self.trajectory
        known = common_times(own.time_s, trajectory.time_s)
        return at_times(trajectory.time_s, trajectory.position, own.time_s[known]), own.position[
            known
        ]

    def alignment(self) -> Alignment | None:
        """Returns the alignment of the estimated to the true trajectory; None if too short."""
        true, own = self.true_and_own()
        return umeyama(own, true) if len(own) > 3 else None


@dataclass(frozen=True)
class Search:
    """Holds one search flight."""

    scenario: Scenario
    uavs: dict[str, Flown]
    wall_s: float
    simulated_s: float
    collisions: int
    trees: Array
    """True trunk bases (N, 2), m, map."""

    @property
    def real_time_factor(self) -> float:
        """Simulated time over wall time."""
        return self.simulated_s / self.wall_s

    def distances_m(self) -> dict[str, float]:
        """Returns each UAV's distance over ground, m."""
        return {name: uav.trajectory.length_m for name, uav in self.uavs.items()}

    def ate_rmse_m(self) -> dict[str, float]:
        """Returns each UAV's absolute trajectory error, m, after alignment."""
        pairs = {name: uav.true_and_own() for name, uav in self.uavs.items()}
        return {name: ate_rmse_m(own, true) for name, (true, own) in pairs.items() if len(own) > 3}

    def searched_m2(self, until_s: float = np.inf) -> float:
        """Returns the area that some UAV came within sight of, m^2."""
        x0, y0, x1, y1 = area_of(self.scenario)
        x, y = (np.arange(a + _CELL_M / 2.0, b, _CELL_M) for a, b in ((x0, x1), (y0, y1)))
        seen = np.zeros((len(y), len(x)), np.bool_)
        for uav in self.uavs.values():
            trajectory = uav.trajectory
            for position in _thinned(trajectory.position[trajectory.time_s <= until_s, :2]):
                seen |= np.hypot(x[None, :] - position[0], y[:, None] - position[1]) <= SIGHT_M
        return float(seen.sum()) * _CELL_M**2

    def trunk_errors_m(self, *, aligned: bool = False) -> Array:
        """Returns distances, m, of trunks seen three times or more from the nearest trees.

        Each UAV maps trunks by its own sensors and estimated trajectory; a false trunk counts with
        its distance from the nearest tree. `aligned`: each map is aligned like the trajectory for
        its error, else by the take-off position alone.
        """
        errors = [np.zeros(0)]
        for uav in self.uavs.values():
            found = uav.survey.trunks(uav.own_trajectory).seen_often
            alignment = uav.alignment() if aligned else None
            if alignment is not None:
                found = alignment.apply(found)
            for trunk in found:
                away = np.hypot(*(self.trees - trunk[:2]).T)
                errors.append(away.min(keepdims=True, initial=np.inf))
        return np.concatenate(errors)

    def target_delays_s(self) -> list[float]:
        """Returns each target's delay from the first list with it to the last, s; inf: never."""
        detections = [
            (seconds, position)
            for uav in self.uavs.values()
            for seconds, positions in uav.targets
            for position in positions
        ]
        delays, known = [], np.zeros((0, 2))
        for _, position in sorted(detections, key=lambda each: each[0]):
            if len(known) and np.hypot(*(known - position).T).min() <= _TARGET_GATE_M:
                continue
            known = np.concatenate([known, position[None]])
            delays_s = [_first_received(uav, position) for uav in self.uavs.values()]
            delays.append(max(delays_s) - min(delays_s))
        return delays

    def target_errors_m(self) -> list[float]:
        """Returns distances of hidden targets from the nearest find, m, without those not found."""
        detections = [p for uav in self.uavs.values() if uav.targets for p in uav.targets[-1][1]]
        errors = []
        for mesh in self.scenario.world.meshes:
            if (mesh.name or "").startswith("target") and detections:
                away = np.hypot(*(np.array(detections) - mesh.position_m[:2]).T).min()
                errors += [float(away)] if away <= 2.0 * _TARGET_GATE_M else []
        return errors


def search_scenario(uavs: int, seed: int, seconds: float) -> Scenario:
    """Returns the scenario with a fleet size, a seed and a duration."""
    return overrides.apply(load_scenario("forest_search"), uavs=uavs, seed=seed, seconds=seconds)


def sparse_scenario(seed: int, seconds: float) -> Scenario:
    """Returns one UAV where fewer than three trunks are in LIDAR range on a third of the area."""
    scenario = search_scenario(1, seed, seconds)
    data = scenario.model_dump(exclude_unset=True)
    data["uavs"][0].update(position_m=[186.0, 162.0], last_position_m=[186.0, 162.0])
    for node in data["types"]["searcher"]["nodes"]:
        if "area_m" in node.get("parameters", {}):
            node["parameters"]["area_m"] = [180.0, 160.0, 260.0, 240.0]
    return parse_scenario(data, access=scenario.access)


def area_of(scenario: Scenario) -> tuple[float, float, float, float]:
    """Returns x_min, y_min, x_max, y_max, m, of the area that the task managers divide."""
    for kind in scenario.types.values():
        for node in kind.nodes:
            if "area_m" in node.parameters:
                x0, y0, x1, y1 = (float(value) for value in node.parameters["area_m"])
                return x0, y0, x1, y1
    raise ValueError(f"{scenario.name}: no node has an area_m")


def fly(scenario: Scenario, *, threads: int = 2) -> Search:
    """Flies the scenario to its end, as fast as possible."""
    with Simulation(scenario, threads=threads) as simulation:
        uavs = {name: Flown() for name in simulation.uavs}
        for name, flown in uavs.items():
            _listen(simulation, name, flown)
        before = time.perf_counter()
        simulation.run()
        wall_s = time.perf_counter() - before
        kinds = (EventKind.IMPACT, EventKind.COLLISION)
        forest = simulation.world.forest
        return Search(
            scenario,
            uavs,
            wall_s,
            simulation.time_s,
            sum(event.kind in kinds for event in simulation.diagnostics.events),
            np.zeros((0, 2)) if forest is None else np.asarray(forest.position_map[:, :2]),
        )


def _listen(simulation: Simulation, name: str, flown: Flown) -> None:
    graph = simulation.graph
    estimate = next(t for t in ESTIMATES if graph.publishers(f"/{name}/{t}"))
    for topic, rows in ((TRUTH, flown.truth), (estimate, flown.estimate)):
        take = _thinning(_POSE_NS, partial(_take_pose, rows))
        graph.subscribe(f"/{name}/{topic}", take)
    for scan in (LEVEL, NODDING):
        take = partial(_take_scan, flown.survey, scan)
        graph.subscribe(f"/{name}/{scan}", take, "sensor_msgs/msg/LaserScan")
    graph.subscribe(f"/{name}/joint_states", partial(_take_nods, flown.survey))
    graph.subscribe("/tf_static", partial(_take_joints, flown.survey))
    targets = partial(_take_targets, flown.targets)
    graph.subscribe(f"/{name}/targets", targets, "volery_interfaces/msg/Targets")


def _thinning(period_ns: int, take: Callable[[Published], None]) -> Callable[[Published], None]:
    """Passes one message per period."""
    next_ns = 0

    def receive(published: Published) -> None:
        nonlocal next_ns
        if published.time_ns >= next_ns:
            next_ns = published.time_ns - published.time_ns % period_ns + period_ns
            take(published)

    return receive


def _take_pose(rows: list[tuple[float, ...]], published: Published) -> None:
    p, q = published.message.pose.pose.position, published.message.pose.pose.orientation
    rows.append((stamp_of(published.message) * 1e-9, p.x, p.y, p.z, q.x, q.y, q.z, q.w))


def _take_scan(survey: TrunkSurvey, scan: str, published: Published) -> None:
    if survey.wants(scan, published.time_ns):
        survey.add_scan(scan, published.time_ns, published.message)


def _take_nods(survey: TrunkSurvey, published: Published) -> None:
    survey.add_nods(published.message)


def _take_joints(survey: TrunkSurvey, published: Published) -> None:
    survey.joints.add(published.message)


def _take_targets(lists: list[tuple[float, Array]], published: Published) -> None:
    positions = [(t.position.x, t.position.y) for t in published.message.targets]
    lists.append((published.time_ns * 1e-9, np.array(positions).reshape(-1, 2)))


def _first_received(uav: Flown, position: Array) -> float:
    for seconds, positions in uav.targets:
        if len(positions) and np.hypot(*(positions - position).T).min() <= _TARGET_GATE_M:
            return seconds
    return np.inf


def _thinned(path: Array, step_m: float = 0.5) -> Array:
    """Returns positions (N, 2) of a path at least `step_m` apart along it."""
    along = np.concatenate([[0.0], np.hypot(*np.diff(path, axis=0).T).cumsum()])
    kept = np.diff(along // step_m, prepend=-1.0) > 0.0
    return path[kept[: len(path)]]
