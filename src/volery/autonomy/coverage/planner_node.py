"""Covers a grid map by several UAVs: one node plans for all and publishes goals.

It waits for a map and for its UAVs' odometry, divides the free cells, requests the take-offs, sends
each UAV the corners of its tour, and lands it at its start. If the map changes, or a UAV times out
or makes no progress, it divides the uncovered cells again.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.coverage import messages
from volery.autonomy.coverage.cells import CoverageCells, Mask
from volery.autonomy.coverage.field import CoverageField
from volery.autonomy.coverage.flight import CoverageFlight, CoveragePhase
from volery.autonomy.coverage.plan import (
    NOT_TO_VISIT,
    UNREACHABLE,
    CoveragePlan,
    plan_coverage,
)
from volery.autonomy.coverage.waypoints import HeightProfile, route_waypoints
from volery.core import rotations
from volery.core.errors import PlanError
from volery.core.saved_state import SavedAttributes
from volery.graph.messages import (
    Float32,
    OccupancyGrid,
    Odometry,
    PathMessage,
    PoseStamped,
    String,
)
from volery.graph.nodes.node import Node
from volery.graph.nodes.service_client import Future

_PERIOD_S = 0.1
_REPEAT = 10
"""Periods after which a goal and the progress are published again: a UAV ignores goals during
take-off.
"""
"""Names of the attributes that a snapshot stores."""


class CoveragePlanner(SavedAttributes, Node):
    """Plans on `/map` for `/uavN/odom`; commands `/uavN/goal_pose`, `take_off` and `land`.

    Parameters
    ----------
    uavs: names of the UAVs.
    height_m: z of the tours in the map.
    layer_spacing_m: height difference between UAVs in transit.
    crossing_height_m: z at which blocked cells may be crossed to reach parts without a UAV;
        0: never.
    acceptance_radius_m: distance at which a waypoint is reached.
    timeout_s: timeout of a UAV's odometry, and of its progress.
    seed: of the division's random numbers.

    """

    STATE = ("_field", "_flights", "_plan", "_covered", "_refused", "_ticks", "_published_covered")

    WARMUP_TASKS = ("volery.autonomy.coverage.warmup:coverage_plans",)

    def __init__(self, **options: Any) -> None:
        super().__init__("coverage", **options)
        names = self.declare_parameter("uavs", ["uav1"]).value
        self._heights = HeightProfile(
            float(self.declare_parameter("height_m", 2.5).value),
            float(self.declare_parameter("layer_spacing_m", 1.5).value),
            float(self.declare_parameter("crossing_height_m", 0.0).value),
        )
        self._acceptance_radius_m = float(self.declare_parameter("acceptance_radius_m", 0.3).value)
        self._timeout_s = float(self.declare_parameter("timeout_s", 10.0).value)
        self._seed = int(self.declare_parameter("seed", 1).value)

        self._field: CoverageField | None = None
        self._flights = [CoverageFlight(name) for name in names]
        self._plan: CoveragePlan | None = None
        self._covered: Mask = np.zeros((0, 0), np.bool_)
        """Sub-cells (2 * rows, 2 * columns) that a UAV has flown through."""
        self._refused = ""
        self._ticks = 0
        self._published_covered = -1

        self._areas = self.create_publisher(OccupancyGrid, "~/areas", 1, latched=True)
        self._covered_map = self.create_publisher(OccupancyGrid, "~/covered", 1, latched=True)
        self._status = self.create_publisher(String, "~/status", 1, latched=True)
        self._progress = self.create_publisher(Float32, "~/progress", 1)
        self._paths, self._goals, self._take_off, self._land = [], [], [], []
        for number, name in enumerate(names):
            self._paths.append(
                self.create_publisher(PathMessage, f"/{name}/coverage/path", 1, latched=True)
            )
            self._goals.append(self.create_publisher(PoseStamped, f"/{name}/goal_pose", 1))
            self._take_off.append(self.create_client("std_srvs/srv/Trigger", f"/{name}/take_off"))
            self._land.append(self.create_client("std_srvs/srv/Trigger", f"/{name}/land"))
            self.create_subscription(Odometry, f"/{name}/odom", self._listener(number), 5)
        self.create_subscription(OccupancyGrid, "/map", self._on_map, 1)
        self.create_timer(_PERIOD_S, self._on_timer)

    # ------------------------------------------------------------------------------ subscriptions

    def _listener(self, number: int) -> Any:
        def on_odometry(message: Odometry) -> None:
            pose, twist = message.pose.pose, message.twist.twist.linear
            turn = pose.orientation
            q = np.array([turn.x, turn.y, turn.z, turn.w])
            velocity = rotations.rotate(q, [twist.x, twist.y, twist.z])
            climb, speed = float(velocity[2]), float(np.hypot(*velocity[:2]))
            position = np.array([pose.position.x, pose.position.y, pose.position.z])
            flight = self._flights[number]
            flight.moved(position, climb, self.get_clock().now_ns(), speed)
            if flight.covers:
                self._mark(position)

        return on_odometry

    def _on_map(self, message: OccupancyGrid) -> None:
        try:
            found = CoverageField.from_message(message)
        except PlanError as error:
            self._refuse(str(error))
            return
        before, self._field = self._field, found
        if before is None or not found.lies_like(before):
            rows, columns = found.free.shape
            self._covered = np.zeros((2 * rows, 2 * columns), np.bool_)
        elif np.array_equal(found.free, before.free):
            return
        if self._plan is not None:
            self._plan_again()

    def _mark(self, position: NDArray[np.float64]) -> None:
        assert self._field is not None
        row, column = self._field.sub_cells_at(position).tolist()
        rows, columns = self._covered.shape
        if 0 <= row < rows and 0 <= column < columns and self._field.free[row // 2, column // 2]:
            self._covered[row, column] = True

    # ----------------------------------------------------------------------------------- planning

    def _plan_first(self) -> None:
        """Plans from the UAVs' positions, which must be in different free cells."""
        assert self._field is not None
        starts = self._field.cells_at(np.array([f.position_map for f in self._flights]))
        self._take_plan(self._flights, starts, self._field.free)

    def _plan_again(self) -> None:
        """Divides the uncovered cells among the able UAVs, from their present positions."""
        assert self._field is not None
        able = [f for f in self._flights if f.phase is not CoveragePhase.FAILED]
        if not able:
            self._refuse("no UAV is left to continue")
            return
        rows, columns = self._field.free.shape
        whole = self._covered.reshape(rows, 2, columns, 2).all(axis=(1, 3))
        left = self._field.free & ~whole
        start_cells = self._field.cells_at(np.array([f.position_map for f in able]))
        self._take_plan(able, self._field.apart(start_cells), left)

    def _take_plan(self, able: list[CoverageFlight], starts: NDArray[np.int64], left: Mask) -> None:
        assert self._field is not None
        over = self._heights.over > 0.0
        free, now = self._field.free, self.get_clock().now_ns()
        try:
            plan = plan_coverage(free, starts, to_visit=left, flies_over=over, seed=self._seed)
        except PlanError as error:
            self._refuse(str(error))
            return
        numbers = [self._flights.index(flight) for flight in able]
        # the last two map the owners -2 and -1, which are no UAVs
        owner = np.array([*numbers, NOT_TO_VISIT, UNREACHABLE], np.int16)[plan.owner]
        self._plan, self._refused = plan, ""
        passable = CoverageCells.of(free)
        for number, flight, tours in zip(numbers, able, plan.routes, strict=True):
            assert flight.position_map is not None
            assert flight.home_map is not None
            if not tours and flight.phase in (CoveragePhase.GROUND, CoveragePhase.DONE):
                continue
            flight.send(
                route_waypoints(
                    self._field,
                    passable,
                    self._heights,
                    number,
                    flight.position_map,
                    flight.home_map,
                    tours,
                ),
                now,
            )
            if flight.phase is CoveragePhase.DONE:
                flight.phase = CoveragePhase.GROUND
            assert flight.waypoints is not None
            self._paths[number].publish(messages.path_message(flight.waypoints, now))
        self._areas.publish(messages.areas_message(self._field, owner, now))
        self._publish_status()

    def _refuse(self, reason: str) -> None:
        if reason != self._refused:
            self._refused = reason
            self._publish_status()

    # ----------------------------------------------------------------------------------- behaviour

    def _on_timer(self) -> None:
        self._ticks += 1
        if self._field is None or any(f.position_map is None for f in self._flights):
            return
        if self._plan is None:
            if not self._refused:
                self._plan_first()
            return
        now = self.get_clock().now_ns()
        for number, flight in enumerate(self._flights):
            self._advance(number, flight, now)
        lost = [f for f in self._flights if self._is_lost(f, now)]
        for flight in lost:
            flight.phase = CoveragePhase.FAILED
        if lost:
            self._plan_again()
        if self._ticks % _REPEAT == 0:
            self._publish_progress()

    def _advance(self, number: int, flight: CoverageFlight, now: int) -> None:
        if flight.waypoints is None:
            return
        if flight.phase is CoveragePhase.GROUND:
            flight.phase = CoveragePhase.TAKE_OFF
            flight.send(flight.waypoints, now)
            self._ask_to_take_off(number, flight)
        elif flight.phase is CoveragePhase.TAKE_OFF and flight.has_climbed:
            self._begin(flight)
        elif flight.phase is CoveragePhase.TAKE_OFF and self._ticks % _REPEAT == 0:
            self._ask_to_take_off(number, flight)
        elif flight.phase is CoveragePhase.COVER:
            goal = flight.goal(self._acceptance_radius_m, now)
            if goal is None:
                if flight.has_stopped(now):  # at its last goal, to which it still flies
                    flight.phase = CoveragePhase.DONE
                    self._land[number].call_async()
                    self._publish_status()
            elif flight.following != flight.published or self._ticks % _REPEAT == 0:
                flight.published = flight.following
                self._goals[number].publish(messages.goal_message(goal, now))

    def _ask_to_take_off(self, number: int, flight: CoverageFlight) -> None:
        def on_answer(answer: Future) -> None:
            refused = answer.exception() is not None or not answer.result().success
            if refused and flight.is_level and flight.phase is CoveragePhase.TAKE_OFF:
                self._begin(flight)  # already airborne; otherwise it will time out

        self._take_off[number].call_async().add_done_callback(on_answer)

    def _begin(self, flight: CoverageFlight) -> None:
        assert flight.waypoints is not None
        flight.phase = CoveragePhase.COVER
        flight.send(flight.waypoints, self.get_clock().now_ns())

    def _is_lost(self, flight: CoverageFlight, now: int) -> bool:
        flies = flight.phase in (CoveragePhase.TAKE_OFF, CoveragePhase.COVER)
        return flies and flight.is_lost(self._timeout_s, now)

    # ---------------------------------------------------------------------------------- publishers

    @property
    def _covered_fraction(self) -> float:
        """Covered fraction of the free cells' quarters."""
        assert self._field is not None
        free = 4 * int(np.count_nonzero(self._field.free))
        fine = np.kron(self._field.free, np.ones((2, 2), np.bool_))
        return float(np.count_nonzero(self._covered & fine)) / max(free, 1)

    def _publish_progress(self) -> None:
        assert self._field is not None
        self._progress.publish(Float32(float(np.float32(self._covered_fraction))))
        count = int(np.count_nonzero(self._covered))
        if count != self._published_covered:
            self._published_covered = count
            now = self.get_clock().now_ns()
            self._covered_map.publish(messages.covered_message(self._field, self._covered, now))
            self._publish_status()

    def _publish_status(self) -> None:
        fraction = 0.0 if self._field is None else self._covered_fraction
        self._status.publish(
            messages.status_message(self._flights, self._plan, fraction, self._refused)
        )
