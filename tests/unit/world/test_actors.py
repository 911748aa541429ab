"""Actors: shapes that are closed, paths by formula, and what rays see of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plain_scene import PlainScene

from volery.core import rotations
from volery.core.errors import CommandError
from volery.world.actors import SHAPES, MovingActor, MovingActors
from volery.world.actors.motions import CircleMotion, GivenMotion, WaypointMotion
from volery.world.materials import Material
from volery.world.scene import Scene, Solid
from volery.world.terrain import Terrain

SQUARE = [[0.0, 0.0, 1.0], [10.0, 0.0, 1.0], [10.0, 10.0, 1.0], [0.0, 10.0, 1.0]]


def yaw(pose):
    return math.degrees(float(rotations.yaw_of(pose[3:])))


@pytest.mark.parametrize("name", SHAPES)
def test_shapes_are_closed_and_face_outwards(name):
    for mesh, _ in SHAPES[name]().parts:
        edges = np.concatenate([mesh.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
        one_way, count = np.unique(edges, axis=0, return_counts=True)
        assert (count == 1).all()
        assert {tuple(e) for e in one_way} == {tuple(e[::-1]) for e in one_way}
        a, b, c = np.moveaxis(mesh.corners.astype(np.float64), 1, 0)
        assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() > 0.0


@pytest.mark.parametrize(
    ("name", "size", "bottom"),
    [
        ("person", (0.42, 0.64, 1.75), 0.0),
        ("car", (4.4, 1.8, 1.45), 0.0),
        ("bird", (0.71, 1.3, 0), None),
    ],
)
def test_shapes_have_their_size(name, size, bottom):
    corners = np.vstack([mesh.vertices for mesh, _ in SHAPES[name]().parts])
    extent = corners.max(axis=0) - corners.min(axis=0)
    np.testing.assert_allclose(extent[:2], size[:2], atol=0.02)
    if bottom is not None:
        assert extent[2] == pytest.approx(size[2], abs=0.01)
        assert corners[:, 2].min() == pytest.approx(bottom, abs=1e-6)


@pytest.mark.parametrize(
    ("point", "inside"),
    [([0, 0, 1.2], True), ([0.1, 0.1, 0.4], True), ([0, 0, 0.4], False), ([0, 0, 1.6], True)],
)
def test_inside_of_a_person(point, inside):
    solids = [Solid(mesh, material, "") for mesh, material in SHAPES["person"]().parts]
    scene = Scene(None, None, solids=solids)
    distance = scene.clearance([point], 1.0).distance[0]
    assert bool(distance < 0.0) is inside
    scene.close()


def test_loops_come_round():
    motion = WaypointMotion(SQUARE, 2.0, "loop", turn_m=0.5)
    for time_s, position, heading in (
        (0.0, (0, 0), -45),  # turning into the corner
        (2.5, (5, 0), 0),
        (5.0, (10, 0), 45),
        (7.5, (10, 5), 90),
        (12.5, (5, 10), 180),
        (17.5, (0, 5), -90),
        (22.5, (5, 0), 0),
        (1002.5, (5, 0), 0),
    ):
        pose = motion.pose_at(time_s)
        np.testing.assert_allclose(pose[:3], [*position, 1.0], atol=1e-6)
        assert math.cos(math.radians(yaw(pose) - heading)) == pytest.approx(1.0, abs=1e-6)
    assert motion.speed_m_s == 2.0


def test_turning_back_and_stopping():
    line = [[0.0, 0.0], [3.0, 4.0], [3.0, 4.0], [6.0, 8.0]]
    ground = Terrain.from_heights([[0.0, 10.0], [0.0, 10.0]], 10.0)  # rises along x
    options = {"start_s": 1.0, "ground": lambda x, y: float(ground.height(x, y))}
    back = WaypointMotion(line, 1.0, "back", **options)
    stop = WaypointMotion(line, 1.0, "stop", **options)
    for motion in (back, stop):
        np.testing.assert_allclose(motion.pose_at(0.5)[:3], [0, 0, 0], atol=1e-9)
        np.testing.assert_allclose(motion.pose_at(6.0)[:3], [3, 4, 3], atol=1e-9)
        assert yaw(motion.pose_at(6.0)) == pytest.approx(math.degrees(math.atan2(4, 3)))
    np.testing.assert_allclose(back.pose_at(13.5)[:2], [4.5, 6.0], atol=1e-9)
    assert yaw(back.pose_at(13.5)) == pytest.approx(math.degrees(math.atan2(-4, -3)))
    np.testing.assert_allclose(back.pose_at(21.5)[:2], back.pose_at(1.5)[:2], atol=1e-9)
    np.testing.assert_allclose(stop.pose_at(99.0)[:3], [6, 8, 6], atol=1e-9)
    assert yaw(stop.pose_at(99.0)) == pytest.approx(math.degrees(math.atan2(4, 3)))


@pytest.mark.parametrize("clockwise", [False, True])
def test_circles_lean_into_the_turn(clockwise):
    motion = CircleMotion((5.0, 5.0, 20.0), 10.0, 7.0, start_rad=0.0, clockwise=clockwise)
    quarter = 0.5 * math.pi * 10.0 / 7.0
    pose = motion.pose_at(quarter)
    np.testing.assert_allclose(pose[:3], [5.0, -5.0 if clockwise else 15.0, 20.0], atol=1e-9)
    centre = np.array([5.0, 5.0, 20.0])
    ahead, left, up = (rotations.rotate(pose[3:], axis) for axis in np.eye(3))
    velocity = (motion.pose_at(quarter + 1e-4) - pose)[:3] / 1e-4
    np.testing.assert_allclose(velocity, 7.0 * ahead, atol=1e-2)
    inwards = (centre - pose[:3]) / 10.0
    # Lift along `up` balances weight and the pull inwards: tan(lean) = v^2 / (g r).
    assert up @ inwards / up[2] == pytest.approx(49.0 / (9.80665 * 10.0))
    assert left @ inwards * (-1 if clockwise else 1) > 0.85


def test_what_was_said_is_known_of_the_past():
    motion = GivenMotion([1, 2, 3, 0, 0, 0, 1])
    motion.set_pose(1.0, [5, 0, 0, 0, 0, 0, 1], [2, 0, 0])
    motion.set_pose(1.1, [9, 0, 0, 0, 0, 0, 1], [0, 0, 0])
    positions = [float(motion.pose_at(t)[0]) for t in (0.5, 1.0, 1.05, 1.1, 7.0)]
    assert positions == pytest.approx([1.0, 5.0, 5.1, 9.0, 9.0])
    for k in range(1000):
        motion.set_pose(2.0 + 0.01 * k, [k, 0, 0, 0, 0, 0, 1], [0, 0, 0])
    assert len(motion._poses) < 40
    assert motion.pose_at(11.9)[0] == 990


def two_actors():
    shapes = {name: SHAPES[name]() for name in SHAPES}
    walk = WaypointMotion([[5.0, -3.0, 0.0], [5.0, 3.0, 0.0]], 1.5, "back")
    return MovingActors(
        [
            MovingActor("anna", "person", shapes["person"], walk),
            MovingActor("van", "car", shapes["car"], GivenMotion([-8, 0, 0, 0, 0, 0, 1])),
        ]
    )


@pytest.mark.parametrize("scene_class", [Scene, PlainScene])
def test_all_see_actors_and_each_copy_its_own_uavs(scene_class):
    from volery.vehicle.airframe import load_airframe
    from volery.vehicle.body_shape import body_shape

    scene = scene_class(None, None)
    actors = two_actors()
    scene.set_actors(actors)
    scene.set_bodies([body_shape(load_airframe("f450"))], [0, 0, 0, 0], num_envs=2)
    scene.move_bodies([[0, 0, 1.2], [2, 0, 1.2]] * 2, [[0, 0, 0, 1.0]] * 4)
    scene.move_actors(2_000_000_000, 2_000_000_000)  # anna passes y = 0
    o, d = [[0.0, 0.0, 1.2]] * 2, [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]
    for row in range(4):
        hits = scene.cast(o, d, 50.0, exclude=row)
        if row % 2:
            o_behind = [[2.0, 0.0, 1.2]] * 2
            hits = scene.cast(o_behind, [[1.0, 0, 0], [0, 0, 1.0]], 50.0, exclude=row)
            assert scene.instance_name(int(hits.instance[0])) == "anna"
            assert hits.distance[0] == pytest.approx(3.0 - 0.2, abs=1e-5)  # turned, .2 m half depth
        else:
            other = row + 1
            assert hits.instance[0] == scene.moving_offset + other
            assert scene.instance_name(int(hits.instance[1])) == "van"
            assert hits.material[1] == Material.RUBBER
            assert hits.distance[1] == pytest.approx(8.0 - 0.9, abs=1e-5)
    not_excluded = scene.cast([[10.0, 0.0, 1.2]], [[-1.0, 0.0, 0.0]], 50.0)
    assert scene.instance_name(int(not_excluded.instance[0])) == "anna"
    assert scene.occluded([[10.0, 0, 1.2]], [[4.0, 0, 1.2]], exclude=0)[0]
    scene.move_actors(0, 0)
    gone = scene.cast([[10.0, 0.0, 1.2]], [[-1.0, 0.0, 0.0]], 7.5)
    assert gone.instance[0] == -1
    half = scene.cast([[10.0, 0.0, 1.2]], [[-1.0, 0.0, 0.0]], 7.5, fraction=0.5)
    scene.move_actors(0, 4_000_000_000)
    half = scene.cast([[10.0, 0.0, 1.2]], [[-1.0, 0.0, 0.0]], 7.5, fraction=0.5)
    assert scene.instance_name(int(half.instance[0])) == "anna"  # half way through the interval
    twin = scene.twin()
    twin.move_actors(2_000_000_000, 2_000_000_000)
    assert twin.cast([[10.0, 0.0, 1.2]], [[-1.0, 0.0, 0.0]], 7.5).instance[0] >= 0
    scene.close()


def test_actors_know_their_poses_and_which_of_them_topics_move():
    actors = two_actors()
    np.testing.assert_allclose(actors.velocity_at(0, 1_000_000_000), [0.0, 1.5, 0.0], atol=1e-6)
    actors.set_pose(1, 10, [0, 0, 0, 0, 0, 0, 1], [3, 0, 0])
    assert actors.speeds_m_s.tolist() == [1.5, 3.0]
    with pytest.raises(CommandError, match="anna has a motion of its own"):
        actors.set_pose(0, 10, [0, 0, 0, 0, 0, 0, 1])
    kept = actors.get_state()
    actors.set_pose(1, 20, [7, 0, 0, 0, 0, 0, 1])
    actors.set_state(kept)
    np.testing.assert_allclose(actors.poses_at(1_000_000_010)[1, :3], [3.0, 0, 0])
