"""The rules of a cooperative search, on a graph without a simulation: UAVs that fly at once."""

from __future__ import annotations

import copy
import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from volery.autonomy.search.calls import JOIN
from volery.autonomy.search.cooperative_search import CooperativeSearch
from volery.autonomy.search.search_positions import (
    Area,
    check_room,
    positions_around,
    random_waypoint,
)
from volery.autonomy.search.teammates import SearchPhase
from volery.core import rng
from volery.core.errors import GraphError
from volery.graph.codecs.zero import zero_message
from volery.graph.graph import Graph
from volery.graph.messages import (
    CameraInfo,
    Image,
    Odometry,
    Point,
    PointStamped,
    header,
    message_type,
    time_from_ns,
)
from volery.graph.nodes.node import Context

AREA = [0.0, 0.0, 40.0, 40.0]
OBJECT = np.array([25.0, 15.0])
TEAM = ["uav1", "uav2", "uav3"]
STEP_NS = 100_000_000
SIDE, FOCAL = 60, 50.0


class Timers:
    """Rings when `Bodies` does so."""

    def __init__(self, callbacks):
        self.callbacks = callbacks

    def every(self, period_s, callback, *, wanted=None):
        assert period_s == STEP_NS / 1e9
        assert wanted()
        self.callbacks.append(callback)

    def forget(self, callback):
        self.callbacks.remove(callback)


class Bodies:
    """Kinematic UAVs and their down cameras around the nodes of a team."""

    def __init__(self, team=TEAM, starts=None, **parameters):
        self.now_ns = 0
        self.graph = Graph(lambda: self.now_ns)
        self.timers = []
        self.object = OBJECT
        self.rotors_turn = True
        self.position = {n: np.array([2.0 + 4.0 * k, 2.0, 0.0]) for k, n in enumerate(team)}
        self.velocity = {n: np.zeros(3) for n in team}
        self.climb_to = dict.fromkeys(team)
        self.sees = set(team)
        self.tracks = {n: [] for n in team}
        self.phases = {n: [] for n in team}
        self.nodes, self.odometry, self.cameras = {}, {}, {}
        self.parameters = {
            "team": team,
            "area_m": AREA,
            "altitude_m": 6.0,
            "gather_s": 3.0,
            "timeout_s": 1.0,
            "hold_s": 1.0,
            **parameters,
        }
        for name in team:
            self.add_body(name)
        for name in team if starts is None else starts:
            self.start(name)

    def add_body(self, name):
        graph = self.graph
        self.odometry[name] = graph.advertise(f"/{name}/odom", Odometry)
        self.cameras[name] = (
            graph.advertise(f"/{name}/down/camera_info", CameraInfo, latched=True),
            graph.advertise(f"/{name}/down/image_raw", Image),
        )
        info = zero_message("sensor_msgs/msg/CameraInfo")
        middle = (SIDE - 1) / 2
        info.k = np.array([FOCAL, 0, middle, 0, FOCAL, middle, 0, 0, 1.0])
        self.cameras[name][0].publish(info)
        self.offer(name, "volery_interfaces/srv/TakeOffTo", "take_off_to", self.take_off)
        self.offer(name, "std_srvs/srv/Trigger", "land", self.land)
        graph.subscribe(
            f"/{name}/cmd_vel", lambda p: self.fly(name, p.message), "geometry_msgs/msg/Twist"
        )

    def offer(self, name, srvtype, service, action):
        def handle(request):
            action(name, request)
            return message_type(f"{srvtype}_Response")(True, "")

        self.graph.create_service(f"/{name}/{service}", srvtype, handle)

    def start(self, name):
        context = Context(self.graph, Timers(self.timers), lambda: self.now_ns)
        self.nodes[name] = CooperativeSearch(
            context=context, namespace=f"/{name}", parameter_overrides=self.parameters
        )

    def take_off(self, name, request):
        if self.rotors_turn:
            self.climb_to[name] = self.position[name][2] + request.altitude

    def land(self, name, _request):
        self.climb_to[name] = 0.0

    def fly(self, name, twist):
        v = twist.linear
        if self.climb_to[name] is None:
            self.velocity[name] = np.array([v.x, v.y, v.z])

    def move(self, name):
        goal = self.climb_to[name]
        if goal is not None:
            self.velocity[name] = np.array(
                [0.0, 0.0, np.clip(goal - self.position[name][2], -1, 1)]
            )
            if abs(goal - self.position[name][2]) < 1e-3:
                self.velocity[name][:] = 0.0
                if goal > 0.0:
                    self.climb_to[name] = None
        self.position[name] = self.position[name] + self.velocity[name] * 0.1
        if goal is not None and abs(goal - self.position[name][2]) < 0.1:
            self.position[name][2] = goal

    def crash(self, name):
        self.position[name][2] = 0.0
        self.climb_to[name] = 0.0

    def image(self, name):
        """Returns the image of a red square of 1 m by a camera that looks down, top ahead (+x)."""
        x, y, z = self.position[name]
        data = np.full((SIDE, SIDE, 3), 90, np.uint8)
        if z > 1.0 and name in self.sees:
            v, u = np.mgrid[:SIDE, :SIDE] - (SIDE - 1) / 2
            east, north = x - v / FOCAL * (z - 0.5), y - u / FOCAL * (z - 0.5)
            red = (abs(east - self.object[0]) < 0.5) & (abs(north - self.object[1]) < 0.5)
            data[red] = 200, 30, 30
        return Image(header(self.now_ns, ""), SIDE, SIDE, "rgb8", 0, 3 * SIDE, data.ravel())

    def step(self):
        self.now_ns += STEP_NS
        for name in self.position:
            self.move(name)
            message = zero_message("nav_msgs/msg/Odometry")
            message.header = header(self.now_ns, "")
            message.pose.pose.position = Point(*self.position[name].tolist())
            message.pose.pose.orientation.w = 1.0
            twist = message.twist.twist.linear
            twist.x, twist.y, twist.z = self.velocity[name].tolist()
            self.odometry[name].publish(message)
            self.cameras[name][1].publish(self.image(name))
        self.graph.deliver()
        for ring in self.timers:
            ring()
            self.graph.deliver()
        for name, node in self.nodes.items():
            self.tracks[name].append(self.position[name].copy())
            self.phases[name].append(node.phase)

    def run_until(self, condition, seconds=300.0):
        for _ in range(round(10 * seconds)):
            if condition():
                return
            self.step()
        raise AssertionError(f"never came: {[node.phase for node in self.nodes.values()]}")

    def run(self, seconds):
        for _ in range(round(10 * seconds)):
            self.step()

    def all_in(self, *phases):
        return lambda: all(node.phase in phases for node in self.nodes.values())

    def call(self, name, finder, stamp_ns=0, position=(25.0, 15.0, 0.5)):
        request = message_type(f"{JOIN}_Request")(time_from_ns(stamp_ns), finder, Point(*position))
        return self.graph.call(f"/{name}/search/join", request)

    def min_distance(self):
        tracks = [np.array(track) for track in self.tracks.values()]
        pairs = itertools.combinations(tracks, 2)
        return min(np.linalg.norm(a - b, axis=1).min() for a, b in pairs)


def searching(**parameters):
    bodies = Bodies(**parameters)
    bodies.run_until(bodies.all_in(SearchPhase.SEARCH))
    return bodies


def test_one_finds_all_come_and_land_where_they_took_off():
    bodies = Bodies()
    homes = copy.deepcopy(bodies.position)
    found = []
    for name in TEAM:
        bodies.graph.subscribe(
            f"/{name}/search/found", lambda p: found.append(p.message.point), PointStamped
        )
    bodies.run_until(bodies.all_in(SearchPhase.HOLD))
    positions = np.array([bodies.position[name] for name in TEAM])
    bodies.run_until(bodies.all_in(SearchPhase.DONE))
    assert np.linalg.norm([found[0].x - 25.0, found[0].y - 15.0]) < 0.3
    away = np.linalg.norm(positions[:, :2] - OBJECT, axis=1)
    assert (away > 2.0).all()
    assert (away < 5.0).all()
    apart = [np.linalg.norm(a - b) for a, b in itertools.combinations(positions[:, :2], 2)]
    assert min(apart) > 2.0
    for name in TEAM:
        assert np.linalg.norm(bodies.position[name] - homes[name]) < 1.0
    assert bodies.min_distance() > 1.5
    inside = np.vstack(list(bodies.tracks.values()))
    assert (inside[:, :2] >= 0.0).all()
    assert (inside[:, :2] <= 40.0).all()


def test_no_uav_leaves_its_column_while_another_climbs_or_sinks():
    bodies = Bodies()
    bodies.run_until(bodies.all_in(SearchPhase.DONE))
    for now in zip(*bodies.phases.values(), strict=True):
        flying = {SearchPhase.SEARCH, SearchPhase.LOOK, SearchPhase.COME, SearchPhase.HOLD}
        assert not (SearchPhase.CLIMB in now and flying & set(now))
        assert not (SearchPhase.LAND in now and (flying | {SearchPhase.HOME}) & set(now))


def test_the_earlier_of_two_finds_counts_whatever_comes_first():
    bodies = searching()
    bodies.sees.clear()
    assert bodies.call("uav1", "uav2", 100).accepted
    assert bodies.nodes["uav1"].phase is SearchPhase.COME
    later = bodies.call("uav1", "uav3", 101)
    assert not later.accepted
    assert "uav2" in later.message
    assert bodies.call("uav1", "uav3", 99, (20.0, 20.0, 0.5)).accepted
    assert bodies.nodes["uav1"].claim.finder == "uav3"
    assert not bodies.call("uav1", "uav2", 100).accepted


def test_of_two_finds_of_one_instant_the_first_name_counts():
    bodies = searching()
    bodies.sees.clear()
    assert bodies.call("uav1", "uav3", 100).accepted
    assert bodies.call("uav1", "uav2", 100).accepted
    assert not bodies.call("uav1", "uav3", 100).accepted


def test_a_second_call_of_the_same_find_changes_nothing():
    bodies = searching()
    bodies.sees.clear()
    assert bodies.call("uav1", "uav2", 100).accepted
    bodies.run_until(lambda: bodies.nodes["uav1"].phase is SearchPhase.HOLD)
    assert bodies.call("uav1", "uav2", 100).accepted
    assert bodies.nodes["uav1"].phase is SearchPhase.HOLD


def test_two_that_find_it_at_once_agree():
    bodies = searching()
    for name in ("uav1", "uav3"):
        bodies.position[name][:2] = OBJECT + 1.0
    bodies.run_until(bodies.all_in(SearchPhase.HOLD))
    assert {node.claim.key for node in bodies.nodes.values()} == {bodies.nodes["uav1"].claim.key}
    assert bodies.nodes["uav3"].claim.finder == "uav1"


def test_a_call_while_it_climbs_is_followed_afterwards():
    bodies = Bodies()
    bodies.run_until(lambda: bodies.nodes["uav1"].phase is SearchPhase.CLIMB)
    bodies.sees.clear()
    assert bodies.call("uav1", "uav2", 100).accepted
    assert bodies.nodes["uav1"].phase is SearchPhase.CLIMB
    bodies.run_until(lambda: bodies.nodes["uav1"].phase is SearchPhase.COME)
    phases = list(dict.fromkeys(bodies.phases["uav1"]))
    assert phases[:3] == [SearchPhase.READY, SearchPhase.CLIMB, SearchPhase.ALOFT]


@pytest.mark.parametrize(
    ("finder", "position", "reason"),
    [
        ("uav9", (25.0, 15.0, 0.0), "not in the team"),
        ("uav1", (25.0, 15.0, 0.0), "not in the team"),
        ("", (25.0, 15.0, 0.0), "the caller is not in the team"),
        ("uav2", (45.0, 15.0, 0.0), "area"),
        ("uav2", (float("nan"), 15.0, 0.0), "area"),
    ],
)
def test_calls_that_are_refused(finder, position, reason):
    bodies = searching()
    answer = bodies.call("uav1", finder, 5, position)
    assert not answer.accepted
    assert reason in answer.message
    assert bodies.nodes["uav1"].phase is SearchPhase.SEARCH


def test_a_uav_that_is_down_refuses_and_is_not_waited_for():
    bodies = searching()
    bodies.crash("uav3")
    bodies.run_until(lambda: bodies.nodes["uav3"].phase is SearchPhase.DOWN)
    assert "down" in bodies.call("uav3", "uav1").message
    others = [bodies.nodes["uav1"], bodies.nodes["uav2"]]
    bodies.run_until(lambda: all(node.phase is SearchPhase.DONE for node in others))
    assert all(SearchPhase.HOLD in bodies.phases[name] for name in ("uav1", "uav2"))


def test_an_absent_teammate_is_waited_for_on_the_ground_and_called_in_vain():
    bodies = Bodies(starts=["uav1", "uav2"])
    bodies.run(2.5)
    assert bodies.all_in(SearchPhase.READY)()
    bodies.run_until(bodies.all_in(SearchPhase.DONE))
    assert all(
        SearchPhase.HOLD in phases for name, phases in bodies.phases.items() if name != "uav3"
    )


def test_a_uav_that_comes_late_stays_on_the_ground():
    bodies = Bodies(starts=["uav1", "uav2"])
    bodies.run_until(lambda: bodies.nodes["uav1"].phase is SearchPhase.SEARCH)
    bodies.start("uav3")
    bodies.run(3.0)
    assert bodies.nodes["uav3"].phase is SearchPhase.LATE
    assert bodies.position["uav3"][2] == 0.0


def test_a_service_that_never_answers_is_called_again_and_given_up():
    bodies = searching()
    bodies.sees = {"uav1"}
    asked = []
    bodies.graph.destroy_service("/uav3/search/join")
    bodies.graph.create_async_service(
        "/uav3/search/join", JOIN, lambda q, _: asked.append(q.finder)
    )
    bodies.run_until(lambda: bodies.nodes["uav1"].phase is SearchPhase.HOME)
    assert asked == ["uav1"] * 20
    assert bodies.nodes["uav2"].phase is SearchPhase.HOME
    bodies.run_until(bodies.all_in(SearchPhase.DONE))


def test_a_false_alarm_ends():
    bodies = searching()
    bodies.run_until(lambda: SearchPhase.LOOK in {node.phase for node in bodies.nodes.values()})
    bodies.sees.clear()
    bodies.run_until(bodies.all_in(SearchPhase.SEARCH), 20.0)
    assert all(node.claim is None for node in bodies.nodes.values())


def test_what_lies_outside_the_area_is_not_found():
    bodies = Bodies()
    bodies.object = np.array([25.0, 41.0])
    bodies.run(100.0)
    assert bodies.all_in(SearchPhase.SEARCH)()


def test_finish_at_one_ends_it_for_all():
    bodies = searching()
    bodies.sees.clear()
    assert bodies.graph.call("/uav2/search/finish").success
    bodies.run_until(bodies.all_in(SearchPhase.DONE), 60.0)
    assert "no longer takes part" in bodies.call("uav1", "uav2").message


def test_a_uav_without_a_finish_service_sees_the_others_go_home():
    bodies = searching()
    bodies.sees.clear()
    for name in ("uav1", "uav3"):
        bodies.graph.destroy_service(f"/{name}/search/finish")
    bodies.graph.call("/uav2/search/finish")
    bodies.run_until(bodies.all_in(SearchPhase.DONE), 60.0)


def test_finish_before_the_take_off_keeps_all_on_the_ground():
    bodies = Bodies()
    bodies.run(0.5)
    bodies.graph.call("/uav2/search/finish")
    bodies.run(0.2)
    assert bodies.all_in(SearchPhase.DONE)()


def test_a_climb_that_fails_is_given_up():
    bodies = Bodies()
    bodies.rotors_turn = False
    bodies.run_until(bodies.all_in(SearchPhase.DOWN), 60.0)


def test_finish_while_they_climb_brings_them_down_again():
    bodies = Bodies()
    bodies.run_until(bodies.all_in(SearchPhase.CLIMB))
    bodies.graph.call("/uav1/search/finish")
    bodies.run_until(bodies.all_in(SearchPhase.DONE), 60.0)
    assert not any(SearchPhase.SEARCH in phases for phases in bodies.phases.values())


def test_a_vain_search_ends_in_time():
    bodies = Bodies(max_search_s=5.0)
    bodies.sees.clear()
    bodies.run_until(bodies.all_in(SearchPhase.DONE), 90.0)


def test_without_images_it_stops():
    bodies = searching()
    bodies.image = lambda _: Image(header(0, ""), 1, 1, "rgb8", 0, 3, np.zeros(3, np.uint8))
    bodies.run(3.0)
    assert all(np.linalg.norm(v) > 1.0 for v in bodies.velocity.values())
    for _, images in bodies.cameras.values():
        images.cancel()
    bodies.run(4.0)
    assert all(np.linalg.norm(v) < 0.1 for v in bodies.velocity.values())


def test_a_kept_state_is_gone_back_to():
    bodies = searching()
    bodies.run_until(lambda: any(n.phase is SearchPhase.COME for n in bodies.nodes.values()))
    kept = copy.deepcopy([node.get_state() for node in bodies.nodes.values()])
    graph, motion = bodies.graph.get_state(), copy.deepcopy((bodies.position, bodies.velocity))
    now_ns = bodies.now_ns

    def fly_on():
        bodies.run(8.0)
        return np.array([bodies.position[name] for name in TEAM])

    once = fly_on()
    bodies.now_ns = now_ns
    bodies.position, bodies.velocity = motion
    bodies.graph.set_state(graph)
    for node, state in zip(bodies.nodes.values(), kept, strict=True):
        node.set_state(state)
    np.testing.assert_array_equal(fly_on(), once)


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"team": ["uav2", "uav3"]}, "must contain 'uav1'"),
        ({"team": ["uav1", "uav1"]}, "each UAV once"),
        ({"area_m": [0.0, 0.0, 8.0, 30.0]}, "12 m a side"),
        ({"area_m": [0.0, 0.0, 1.0, 30.0]}, "wider than its borders"),
        ({"area_m": [0.0, 0.0, 1.0]}, "area_m must be 4 numbers"),
        ({"layer_spacing_m": 0.1}, "layer_spacing_m must be a number of at least 0.5"),
    ],
)
def test_parameters_that_make_no_sense(parameters, reason):
    context = Context(Graph(lambda: 0), Timers([]), lambda: 0)
    overrides = {"team": TEAM, **parameters}
    with pytest.raises(GraphError, match=reason):
        CooperativeSearch(context=context, namespace="/uav1", parameter_overrides=overrides)


def test_waypoints_fill_the_area_and_nothing_else():
    area = Area(-10.0, 5.0, 30.0, 15.0)
    points = [
        np.array([random_waypoint(area, rng.stream_key(1, name), n) for n in range(500)])
        for name in TEAM
    ]
    for drawn in points:
        assert all(area.holds(*point) for point in drawn)
        np.testing.assert_allclose(drawn.mean(axis=0), [10.0, 10.0], atol=1.5)
        np.testing.assert_allclose(drawn.std(axis=0), np.array([40, 10]) / 12**0.5, rtol=0.08)
    assert not np.allclose(points[0], points[1])


@given(
    st.integers(1, 12),
    st.floats(0.5, 5.0),
    st.floats(0.0, 40.0),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
)
def test_there_is_room_around_every_position(count, apart, longer, x, y):
    side = next(s for s in itertools.count(1) if _is_roomy(count, apart, float(s)))
    area = Area(3.0, -4.0, 3.0 + side + longer, -4.0 + side)
    position = np.array([3.0 + x * (side + longer), -4.0 + y * side])
    positions = positions_around(position, count, apart, area)
    assert positions.shape == (count, 2)
    assert all(area.holds(*p) for p in positions)
    everything = np.vstack([position[None], positions])
    away = np.linalg.norm(everything[:, None] - everything, axis=2)
    assert away[~np.eye(count + 1, dtype=bool)].min() > apart * (1.0 - 1e-9)


def _is_roomy(count, apart, side):
    try:
        check_room(count, apart, Area(0.0, 0.0, side, side))
    except GraphError:
        return False
    return True
