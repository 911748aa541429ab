"""Tests conservative advancement against brute force: rare queries, no missed contact."""

import numpy as np
import pytest

from volery.control.fleet import Fleet
from volery.core import rotations
from volery.engine.collisions import BOUNCE, CRASH, Collisions
from volery.engine.events import EventKind
from volery.vehicle.airframe import load_airframe
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.scene import Scene, Solid
from volery.world.terrain import Terrain

F450 = load_airframe("f450")
RADIUS = F450.body.collision_radius_m
GROUND = Terrain.flat(extent_m=200.0, height_m=-100.0)


def wall(x):
    """A thin pane across x, 40 m wide and high."""
    corners = [[x, -20, -20], [x, 20, -20], [x, 20, 20], [x, -20, 20]]
    mesh = Mesh(np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.uint32))
    return Solid(mesh, Material.WALL, "wall")


class Flight:
    """UAVs without gravity's help: their rotors hover, so that they fly nearly straight."""

    def __init__(self, positions, velocities, *, solids=(), response=CRASH):
        count = len(positions)
        self.fleet = Fleet([F450] * count, positions, np.tile(rotations.IDENTITY, (count, 1)))
        self.fleet.state.velocity_map[:] = velocities
        for i in range(count):
            self.fleet.command_rotor_speeds(i, np.full(4, 770.0))
        self.scene = Scene(GROUND, None, solids=solids)
        self.events = []
        names = tuple(f"uav{i + 1}" for i in range(count))
        self.collisions = Collisions(self.fleet, self.scene, names, response, self.events.append)
        self.looks = 0
        self.nearest_pair = np.inf

    def run(self, steps):
        end = self.fleet.step + steps
        self.collisions.resolve(0)
        while self.fleet.step < end:
            self.fleet.advance(end - self.fleet.step, GROUND.grid)
            self.looks += 1
            self.collisions.resolve(self.fleet.time_ns)
            p = self.fleet.state.position_map
            gaps = np.linalg.norm(p[:, None] - p[None], axis=2) + 1e9 * np.eye(len(p))
            self.nearest_pair = min(self.nearest_pair, gaps.min())
        self.scene.close()


@pytest.mark.parametrize("speed", [1.0, 25.0, 60.0])
def test_a_thin_pane_is_hit_at_any_speed_at_the_right_position(speed):
    pane = RADIUS + 0.3  # near: without control, drag above its centre tips a slow vehicle back
    flight = Flight([[0, 0, 0]], [[speed, 0, 0]], solids=[wall(pane)])
    flight.run(3000)
    (event, *_) = flight.events
    assert event.kind is EventKind.COLLISION
    assert event.partner == "wall"
    assert event.position_map[0] == pytest.approx(0.3, abs=speed * 1e-3 + 2e-3)
    assert flight.fleet.state.position_map[0, 0] < pane
    assert flight.fleet.state.crashed[0]


def test_one_touch_is_one_event():
    flight = Flight([[0, 0, 0]], [[5, 0, 0]], solids=[wall(1.5)])
    flight.run(1500)
    assert len(flight.events) == 1


def test_bouncing_off_and_flying_on():
    flight = Flight([[0, 0, 0]], [[5, 0, 0]], solids=[wall(1.5)], response=BOUNCE)
    flight.run(500)
    assert len(flight.events) == 1
    assert flight.fleet.state.velocity_map[0, 0] < -0.5
    assert not flight.fleet.state.crashed[0]


def test_nothing_near_means_hardly_any_looks():
    flight = Flight([[0, 0, 0]], [[5, 0, 0]])
    flight.run(2000)
    assert flight.events == []
    assert flight.looks < 10


@pytest.mark.parametrize("miss", [0.5, 0.73, 0.75, 1.0])
def test_two_that_pass_touch_exactly_when_their_spheres_do(miss):
    flight = Flight([[-5, 0, 0], [5, miss, 0]], [[25, 0, 0], [-25, 0, 0]])
    flight.run(400)
    touched = bool(flight.events)
    assert touched == (miss < 2 * RADIUS), flight.events
    if touched:
        assert {e.uav for e in flight.events} == {"uav1", "uav2"}


@pytest.mark.parametrize("seed", range(4))
def test_a_crowd_never_overlaps_unnoticed(seed):
    generator = np.random.default_rng(seed)
    positions = generator.uniform(-6, 6, (12, 3))
    apart = np.linalg.norm(positions[:, None] - positions[None], axis=2) + 9 * np.eye(12)
    positions *= max(1.0, 1.0 / apart.min())
    flight = Flight(positions, generator.uniform(-8, 8, (12, 3)))
    flight.run(800)
    # Brute force over the looks: each pair closer than two radii was reported.
    assert (flight.nearest_pair < 2 * RADIUS - 1e-3) <= bool(flight.events)
    assert flight.nearest_pair > 2 * RADIUS - 0.1
