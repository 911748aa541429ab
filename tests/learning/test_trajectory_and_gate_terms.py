"""Trajectories are followed where they are; gates are passed in order, and frames are hit."""

from dataclasses import replace

import numpy as np
import pytest

from volery.core import rotations
from volery.learning.episodes import Episodes
from volery.learning.tasks import load_task
from volery.learning.terms import gates, trajectories
from volery.learning.terms.gates import Frame, Race
from volery.runtime.environment_start import EnvironmentStart


@pytest.fixture
def episodes():
    """Episodes of a task by name, which have begun in two environments."""
    made = []

    def begun(name, **changes):
        made.append(Episodes(replace(load_task(name), **changes), 2, threads=1))
        made[-1].begin(np.arange(2))
        return made[-1]

    yield begun
    for each in made:
        each.close()


def put(episodes, position, attitude=(0.0, 0.0, 0.0, 1.0)):
    episodes.envs.reset(start=EnvironmentStart(position, attitude))
    episodes.flight.refresh()


# ------------------------------------------------------------------------------------ trajectories


def test_the_velocity_is_the_slope_of_the_curve():
    draw = np.random.default_rng(1)
    curves = draw.uniform(0.5, 2.0, (3, 4, 3))
    time = np.linspace(0.0, 5.0, 40)[None].repeat(3, axis=0)
    position, velocity = trajectories.curve_motion(curves, time)
    later, _ = trajectories.curve_motion(curves, time + 1e-6)
    np.testing.assert_allclose((later - position) / 1e-6, velocity, atol=1e-5)
    apart = np.abs(position - curves[:, None, 0])
    assert (apart <= curves[:, None, 1] + 1e-12).all()


def test_uavs_start_on_the_curve_and_points_ahead_are_in_the_body_frame(episodes):
    own = episodes("tracking")
    flight = own.flight
    goal = flight.values["goal_map"]
    assert (np.linalg.norm(goal - flight.state.position_map, axis=-1) <= 0.3).all()
    curve = flight.values["curve"]
    speed = np.abs(curve[:, 1] * curve[:, 2])
    assert ((speed[:, :2] >= 1.5) & (speed[:, :2] <= 3.5)).all()
    turned = rotations.from_rpy(0.0, 0.0, np.pi / 2.0)
    put(own, goal, turned)
    ahead = trajectories.reference_ahead((0.0, 0.2)).function(flight)
    np.testing.assert_allclose(ahead[..., :3], 0.0, atol=1e-12)
    points, _ = trajectories.curve_motion(curve, np.full((2, 1), 0.2))
    step = points - goal
    expected = np.stack([step[..., 1], -step[..., 0], step[..., 2]], axis=-1)
    np.testing.assert_allclose(ahead[..., 3:], expected, atol=1e-12)


def test_the_mean_error_counts_after_the_first_second(episodes):
    own = episodes("tracking", terminations=())
    flight = own.flight
    apart = np.array([0.3, 0.0, 0.4])
    for decision in range(1, 71):
        flight.decisions[:] = decision
        time = np.full((2, 1), decision / 50.0)
        point, _ = trajectories.curve_motion(flight.values["curve"], time)
        put(own, point + apart * (1.0 if decision > 50 else 9.0))
        trajectories.follow(flight)
    np.testing.assert_allclose(flight.values["goal_map"], point)
    np.testing.assert_allclose(trajectories.mean_error(flight), 0.5)
    assert not own.task.success(flight).any()
    flight.values["error_m"][:] = 0.0
    assert own.task.success(flight).all()


# ------------------------------------------------------------------------------------------- gates


def course(episodes):
    """Two gates along x at 4 and 8 m, 2 m high; the second one faces along y."""
    own = episodes("gates", terminations=())
    layout = [[4.0, 0.0, 2.0, 0.0], [8.0, 0.0, 2.0, np.pi / 2.0], [8.0, 5.0, 2.0, np.pi / 2.0]]
    values = own.flight.values
    values["gates"] = np.array([layout, layout])
    values["next_gate"][:] = 0.0
    values["goal_map"][:] = [4.0, 0.0, 2.0]
    return own


def move(own, before, after):
    """Moves the UAVs between two decisions; returns passed gates and hit frames (K,)."""
    values = own.flight.values
    values["last_position_map"][:] = before
    put(own, np.broadcast_to(after, (2, 1, 3)))
    Race(Frame())(own.flight)
    return values["passed_gate"][:, 0].tolist(), values["frame_hit"][:, 0].tolist()


def test_gates_count_in_order_and_in_their_direction(episodes):
    own = course(episodes)
    assert move(own, [7.9, -0.3, 2.0], [7.9, 0.3, 2.0]) == ([0, 0], [0, 0])
    assert move(own, [4.3, 0.0, 2.0], [3.7, 0.0, 2.0]) == ([0, 0], [0, 0])
    assert move(own, [3.7, 0.1, 2.1], [4.3, 0.1, 2.1]) == ([1, 1], [0, 0])
    assert own.flight.values["next_gate"].tolist() == [[1.0], [1.0]]
    np.testing.assert_array_equal(own.flight.values["goal_map"][:, 0], [[8.0, 0.0, 2.0]] * 2)
    assert move(own, [3.7, 0.1, 2.1], [4.3, 0.1, 2.1]) == ([0, 0], [0, 0])
    assert not gates.finished().function(own.flight).any()
    assert move(own, [8.1, -0.3, 2.0], [8.1, 0.3, 2.0]) == ([1, 1], [0, 0])
    assert gates.finished().function(own.flight).all()


@pytest.mark.parametrize(
    ("before", "after", "passed", "hit"),
    [
        ([3.7, 0.75, 2.0], [4.3, 0.75, 2.0], 0, 1),  # through the left border
        ([3.7, 0.0, 2.9], [4.3, 0.0, 2.9], 0, 1),  # through the upper one
        ([4.3, -0.9, 2.0], [3.7, -0.9, 2.0], 0, 1),  # backwards through the right one
        ([3.0, 0.9, 2.0], [3.9, 0.9, 2.0], 0, 1),  # stops at the border
        ([3.7, 2.0, 2.0], [4.3, 2.0, 2.0], 0, 0),  # outside of the gate
        ([3.7, 0.4, 1.7], [4.3, 0.4, 1.7], 1, 0),
    ],
)
def test_frames_are_hit(episodes, before, after, passed, hit):
    own = course(episodes)
    assert move(own, before, after) == ([passed] * 2, [hit] * 2)
    assert gates.frame_hit().function(own.flight).tolist() == [bool(hit)] * 2


def test_progress_is_towards_the_next_gate(episodes):
    own = course(episodes)
    move(own, [1.0, 0.0, 2.0], [1.5, 0.0, 2.0])
    np.testing.assert_allclose(gates.progress(1.0).function(own.flight), 0.5)


def test_gates_are_seen_in_the_heading_frame(episodes):
    own = course(episodes)
    put(own, [4.0, -2.0, 2.0], rotations.from_rpy(0.0, 0.3, np.pi / 2.0))
    seen = gates.gates_heading(2).function(own.flight)[0, 0]
    np.testing.assert_allclose(seen, [2.0, 0.0, 0.0, 2.0, -4.0, 0.0], atol=1e-12)
    directions = gates.gate_directions_heading(2).function(own.flight)[0, 0]
    np.testing.assert_allclose(directions, [0.0, -1.0, 1.0, 0.0], atol=1e-12)


def test_courses_are_drawn_within_their_bounds(episodes):
    own = episodes("gates")
    layout = own.flight.values["gates"]
    steps = np.diff(np.insert(layout[..., :2], 0, 0.0, axis=1), axis=1)
    length = np.linalg.norm(steps, axis=-1)
    assert ((length >= 4.0) & (length <= 6.0)).all()
    assert (np.abs(layout[..., 2] - 4.0) <= 0.7).all()
    heading = np.arctan2(steps[..., 1], steps[..., 0])
    turn = np.angle(np.exp(1j * np.diff(heading, axis=1)))
    assert (np.abs(turn) <= np.radians(45.0) + 1e-9).all()
    facing = np.angle(np.exp(1j * (layout[..., 3] - heading)))
    assert (np.abs(facing) <= np.radians(15.0) + 1e-9).all()
    assert (layout[0] != layout[1]).any()
