"""One flight of the scenario `forest_search`, and what is measured of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from volery.engine.events import EventKind
from volery.graph.messages import Published, stamp_of
from volery.report.alignment import Alignment, at_times, ate_rmse_m, common_times, umeyama
from volery.report.logged_flights import ESTIMATES, TRUTH
from volery.report.trajectories import RecordedTrajectory
from volery.report.trunk_survey import LEVEL, NODDING, TrunkSurvey
from volery.runtime import Simulation
from volery.scenario import overrides
from volery.scenario.load import load_scenario, parse_scenario
from volery.scenario.schema import Scenario

Array = NDArray[np.float64]

SIGHT_M = 6.0
"""As far as the task manager takes a place for seen."""
_CELL_M = 2.0
_POSE_NS = 100_000_000
_TARGET_GATE_M = 4.0


@dataclass
class Flown:
    """What is gathered of one UAV. Times are s."""

    truth: list[tuple[float, ...]] = field(default_factory=list)
    """Time, position (3), attitude (4)."""
    estimate: list[tuple[float, ...]] = field(default_factory=list)
    survey: TrunkSurvey = field(default_factory=TrunkSurvey)
    """What its trunks are told from."""
    targets: list[tuple[float, Array]] = field(default_factory=list)
    """Time, and the places (T, 2) on its list, whenever it is published."""

    @property
    def way(self) -> RecordedTrajectory:
        """Where it truly was."""
        return RecordedTrajectory.of_rows(self.truth)

    @property
    def own_way(self) -> RecordedTrajectory:
        """Where it thought it was."""
        return RecordedTrajectory.of_rows(self.estimate)

    def way_and_own(self) -> tuple[Array, Array]:
        """Places (N, 3) where it truly was, and where it thought it was at these times."""
        own, way = self.own_way, self.way
        known = common_times(own.time_s, way.time_s)
        return at_times(way.time_s, way.position, own.time_s[known]), own.position[known]

    def alignment(self) -> Alignment | None:
        """What brings its own way as near to the true one as may be."""
        true, own = self.way_and_own()
        return umeyama(own, true) if len(own) > 3 else None


@dataclass(frozen=True)
class Search:
    """One search that was flown."""

    scenario: Scenario
    uavs: dict[str, Flown]
    wall_s: float
    simulated_s: float
    collisions: int
    trees: Array
    """(N, 2) true feet of the trees, m, map."""

    @property
    def real_time_factor(self) -> float:
        """Simulated seconds a wall second."""
        return self.simulated_s / self.wall_s

    def distances_m(self) -> dict[str, float]:
        """How far each has flown over ground."""
        return {name: uav.way.length_m for name, uav in self.uavs.items()}

    def ate_rmse_m(self) -> dict[str, float]:
        """Error of each UAV's own idea of its way, after alignment."""
        pairs = {name: uav.way_and_own() for name, uav in self.uavs.items()}
        return {name: ate_rmse_m(own, true) for name, (true, own) in pairs.items() if len(own) > 3}

    def searched_m2(self, until_s: float = np.inf) -> float:
        """Size of the part of the area that somebody came within sight of."""
        x0, y0, x1, y1 = area_of(self.scenario)
        x, y = (np.arange(a + _CELL_M / 2.0, b, _CELL_M) for a, b in ((x0, x1), (y0, y1)))
        seen = np.zeros((len(y), len(x)), np.bool_)
        for uav in self.uavs.values():
            way = uav.way
            for place in _thinned(way.position[way.time_s <= until_s, :2]):
                seen |= np.hypot(x[None, :] - place[0], y[:, None] - place[1]) <= SIGHT_M
        return float(seen.sum()) * _CELL_M**2

    def trunk_errors_m(self, *, aligned: bool = False) -> Array:
        """Distances of mapped trunks from the nearest trees, of those seen three times or more.

        They are all that each UAV takes for trunks by its own sensors and its own idea of its way;
        what is none is as far off as the next tree stands. `aligned`: each UAV's map is laid onto
        the world as its way is for the trajectory error, else by the place of take-off alone.
        """
        errors = [np.zeros(0)]
        for uav in self.uavs.values():
            found = uav.survey.trunks(uav.own_way).seen_often
            alignment = uav.alignment() if aligned else None
            if alignment is not None:
                found = alignment.apply(found)
            for trunk in found:
                away = np.hypot(*(self.trees - trunk[:2]).T)
                errors.append(away.min(keepdims=True, initial=np.inf))
        return np.concatenate(errors)

    def target_delays_s(self) -> list[float]:
        """For each thing found: from the first list that has it to the last one, inf if never."""
        finds = [
            (seconds, place)
            for uav in self.uavs.values()
            for seconds, places in uav.targets
            for place in places
        ]
        delays, known = [], np.zeros((0, 2))
        for _, place in sorted(finds, key=lambda each: each[0]):
            if len(known) and np.hypot(*(known - place).T).min() <= _TARGET_GATE_M:
                continue
            known = np.concatenate([known, place[None]])
            heard = [_first_heard(uav, place) for uav in self.uavs.values()]
            delays.append(max(heard) - min(heard))
        return delays

    def target_errors_m(self) -> list[float]:
        """Distance of each hidden thing from the nearest find; those not found are left out."""
        finds = [p for uav in self.uavs.values() if uav.targets for p in uav.targets[-1][1]]
        errors = []
        for mesh in self.scenario.world.meshes:
            if (mesh.name or "").startswith("target") and finds:
                away = np.hypot(*(np.array(finds) - mesh.position_m[:2]).T).min()
                errors += [float(away)] if away <= 2.0 * _TARGET_GATE_M else []
        return errors


def search_scenario(uavs: int, seed: int, seconds: float) -> Scenario:
    """The scenario with so many UAVs, a seed and a duration."""
    return overrides.apply(load_scenario("forest_search"), uavs=uavs, seed=seed, seconds=seconds)


def sparse_scenario(seed: int, seconds: float) -> Scenario:
    """One UAV where on a third of the area less than three trunks are in a LIDAR's reach."""
    scenario = search_scenario(1, seed, seconds)
    data = scenario.model_dump(exclude_unset=True)
    data["uavs"][0].update(position_m=[186.0, 162.0], last_position_m=[186.0, 162.0])
    for node in data["types"]["searcher"]["nodes"]:
        if "area_m" in node.get("parameters", {}):
            node["parameters"]["area_m"] = [180.0, 160.0, 260.0, 240.0]
    return parse_scenario(data, access=scenario.access)


def area_of(scenario: Scenario) -> tuple[float, float, float, float]:
    """x_min, y_min, x_max, y_max that the task managers share out."""
    for kind in scenario.types.values():
        for node in kind.nodes:
            if "area_m" in node.parameters:
                x0, y0, x1, y1 = (float(value) for value in node.parameters["area_m"])
                return x0, y0, x1, y1
    raise ValueError(f"{scenario.name}: no node has an area_m")


def fly(scenario: Scenario, *, threads: int = 2) -> Search:
    """Fly it to its end, as fast as possible."""
    with Simulation(scenario, threads=threads) as simulation:
        uavs = {name: Flown() for name in simulation.uavs}
        for name, flown in uavs.items():
            _listen(simulation, name, flown)
        before = time.perf_counter()
        simulation.run()
        wall_s = time.perf_counter() - before
        kinds = (EventKind.IMPACT, EventKind.COLLISION)
        forest = simulation.forest
        return Search(
            scenario,
            uavs,
            wall_s,
            simulation.time_s,
            sum(event.kind in kinds for event in simulation.events),
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
    """Let one message a period through."""
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
    places = [(t.position.x, t.position.y) for t in published.message.targets]
    lists.append((published.time_ns * 1e-9, np.array(places).reshape(-1, 2)))


def _first_heard(uav: Flown, place: Array) -> float:
    for seconds, places in uav.targets:
        if len(places) and np.hypot(*(places - place).T).min() <= _TARGET_GATE_M:
            return seconds
    return np.inf


def _thinned(way: Array, step_m: float = 0.5) -> Array:
    """Places (N, 2) of a way, no nearer to each other along it than `step_m`."""
    along = np.concatenate([[0.0], np.hypot(*np.diff(way, axis=0).T).cumsum()])
    kept = np.diff(along // step_m, prepend=-1.0) > 0.0
    return way[kept[: len(way)]]
