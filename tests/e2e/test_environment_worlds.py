"""Environments in several worlds: each is the simulation of its seed in its world."""

import contextlib
import copy
import pickle

import numpy as np
import pytest

from volery.core.errors import CommandError, ScenarioError, SensorError
from volery.runtime import Simulation, VectorizedSimulation
from volery.runtime.environment_start import EnvironmentStart
from volery.scenario.load import parse_scenario
from volery.sensors.cameras.camera import take

WORLDS = (11, 12, 13)
STATES = ("position_map", "velocity_map", "attitude", "omega_body", "rotor_speed", "crashed")
SAMPLES = {
    "horizontal": ("echoes",),
    "camera": ("colour", "depth", "instance", "material"),
    "range": ("ranges",),
    "imu": ("specific_force",),
}
FOREST = {
    "name": "small_wood",
    "physics": {"rate_hz": 500, "guidance_rate_hz": 100},
    "world": {
        "terrain": {"kind": "flat", "extent_m": 30.0},
        "forest": {
            "kind": "procedural",
            "region_m": [-9.0, -9.0, 9.0, 9.0],
            "trees": 50,
            "minimum_spacing_m": 1.5,
            "species": {"snag": 0.5, "conifer": 0.5},
        },
    },
    "types": {
        "f450": {
            "airframe": "f450",
            "flight": {"take_off_altitude_m": 1.0},
            "sensors": [
                {"kind": "lidar", "name": "horizontal", "position_m": [0.0, 0.0, 0.18]},
                {
                    "kind": "camera",
                    "width": 16,
                    "height": 12,
                    "position_m": [0.12, 0.0, 0.0],
                    "rpy_deg": [0.0, 20.0, 0.0],
                },
                {"kind": "sonar", "rpy_deg": [0.0, 90.0, 0.0]},
                {"kind": "imu"},
            ],
        }
    },
    "uavs": [
        {
            "type": "f450",
            "position_m": [0.0, 0.0],
            "placement": "nearest_free",
            "on_start": "take_off",
        }
    ],
}
TAKE_OFF_S = 3.0
VELOCITY = [4.0, 1.3, 0.2]
START = EnvironmentStart([-11.0, -3.0, 1.5])


def scenario():
    return parse_scenario(copy.deepcopy(FOREST))


def fly(source, start):
    """Flies across the wood; from the ground without a start in the air."""
    if start is None:
        source.run(TAKE_OFF_S)
    cross(source, source.command_velocity)


def cross(source, command):
    """Flies on for 1.6 s; a velocity holds for half a second."""
    for _ in range(4):
        command(VELOCITY)
        source.run(0.4)


def flying_on(uav):
    """A wreck refuses commands; environments leave it out of them."""

    def command(velocity):
        with contextlib.suppress(CommandError):
            uav.command_velocity(velocity)

    return command


def measured(envs, env):
    """States and last samples of one environment, and where it hit something."""
    state = envs.state()
    found = {name: getattr(state, name)[env] for name in STATES}
    for sensor, arrays in SAMPLES.items():
        batch = envs.sample("uav1", sensor)
        found |= {f"{sensor}.{name}": batch[name][env] for name in arrays}
    return found


def assert_same(found, expected):
    for name, array in expected.items():
        np.testing.assert_array_equal(found[name], array, err_msg=name)


def alone(seed, world, start):
    """The only environment of a vectorized simulation of one world, after the same flight."""
    own = scenario().with_(world={"seed": world})
    with VectorizedSimulation(own, 1, seeds=[seed], threads=1) as envs:
        if start is not None:
            envs.reset(start=start)
        fly(envs, start)
        return measured(envs, 0)


@pytest.fixture(scope="module", params=[1, 2])
def flown(request):
    """Four environments in three worlds after a flight in the air, by 1 and 2 threads."""
    with VectorizedSimulation(
        scenario(), 4, seeds=[5, 6, 7, 8], threads=request.param, worlds=WORLDS
    ) as envs:
        envs.reset(start=START)
        fly(envs, START)
        yield envs


def test_environments_are_dealt_over_the_worlds(flown):
    assert flown.worlds == WORLDS
    assert flown.world.tolist() == [0, 1, 2, 0]
    assert flown.scenario.world_seed == WORLDS[0]


@pytest.mark.parametrize("env", [1, 3])
def test_an_environment_equals_the_only_one_of_its_world(flown, env):
    world = WORLDS[flown.world[env]]
    assert_same(measured(flown, env), alone(5 + env, world, START))


def test_an_environment_equals_the_simulation_of_its_world():
    """Position, LIDAR, camera and contacts, from a start that each world has elsewhere."""
    with VectorizedSimulation(scenario(), 3, seeds=[5, 6, 7], threads=2, worlds=WORLDS) as envs:
        starts = envs.state().position_map[:, 0]
        fly(envs, None)
        found = [measured(envs, env) for env in range(3)]
    for env, seed in enumerate((5, 6, 7)):
        own = scenario().with_(seed=seed, world={"seed": WORLDS[env]})
        with Simulation(own, threads=1) as simulation:
            uav = simulation.uavs["uav1"]
            np.testing.assert_array_equal(uav.position_map, starts[env])
            with contextlib.suppress(SensorError):  # cameras render for readers
                uav.sensors["camera"].latest  # noqa: B018
            simulation.run(TAKE_OFF_S)
            cross(simulation, uav.command_velocity)
            state = simulation._engine.fleet.state
            assert_same(found[env], {name: getattr(state, name) for name in STATES})
            scan, image = uav.sensors["horizontal"].latest, uav.sensors["camera"].latest
            np.testing.assert_array_equal(found[env]["horizontal.echoes"], scan.echoes)
            np.testing.assert_array_equal(found[env]["camera.colour"], image.image)
            np.testing.assert_array_equal(found[env]["camera.depth"], image.depth)


def test_contacts_between_ticks_are_those_of_the_simulation():
    """Without sensors, whose samples end ticks."""
    own = scenario().with_({"types.f450.sensors": []})
    with VectorizedSimulation(own, 3, seeds=[5, 6, 7], threads=1, worlds=WORLDS) as envs:
        fly(envs, None)
        cross(envs, envs.command_velocity)
        state, hits = envs.state(), [(e.env, e.event.time_ns) for e in envs.drain_events()]
    assert state.crashed.any()
    for env, seed in enumerate((5, 6, 7)):
        alike = own.with_(seed=seed, world={"seed": WORLDS[env]})
        with Simulation(alike, threads=1) as simulation:
            simulation.run(TAKE_OFF_S)
            for _ in range(2):
                cross(simulation, flying_on(simulation.uavs["uav1"]))
            single = simulation._engine.fleet.state
            times = [event.time_ns for event in simulation.diagnostics.events]
        assert_same(
            {name: getattr(state, name)[env] for name in STATES},
            {name: getattr(single, name) for name in STATES},
        )
        assert [time for number, time in hits if number == env] == times


def test_a_reset_moves_environments_to_other_worlds(flown):
    before = measured(flown, 2)
    flown.reset([0, 3], seeds=[6, 7], start=START, worlds=[1, 2])
    assert flown.world.tolist() == [1, 1, 2, 2]
    saved = pickle.loads(pickle.dumps(flown.get_state()))
    fly(flown, START)
    found = [measured(flown, env) for env in (0, 3)]
    assert_same(found[0], alone(6, WORLDS[1], START))
    assert_same(found[1], alone(7, WORLDS[2], START))
    flown.reset([0], worlds=[0])
    flown.set_state(saved)
    assert flown.world.tolist() == [1, 1, 2, 2]
    assert_same(measured(flown, 2), before)
    fly(flown, START)
    assert_same(measured(flown, 3), found[1])


def test_a_reset_to_the_ground_starts_where_the_other_world_starts():
    with VectorizedSimulation(scenario(), 2, seeds=[5, 6], threads=1, worlds=WORLDS[:2]) as envs:
        envs.run(0.1)
        envs.reset([0], seeds=[9], worlds=[1])
        fly(envs, None)
        found = measured(envs, 0)
    assert_same(found, alone(9, WORLDS[1], None))


def test_contacts_are_with_the_trees_of_the_own_world():
    own = scenario().with_(world={"seed": WORLDS[1]})
    with VectorizedSimulation(own, 1, threads=1) as envs:
        forest = envs.forest
    thickest = int(np.argmax(forest.dbh_m))
    start = EnvironmentStart(
        forest.position_map[thickest] + [-1.0, 0.0, 1.0], velocity_map=[3.0, 0.0, 0.0]
    )
    with VectorizedSimulation(scenario(), 2, seeds=[5, 6], threads=2, worlds=WORLDS[:2]) as envs:
        envs.reset(start=start)
        envs.run(0.5)
        hits = {e.env: e.event.partner for e in envs.drain_events() if e.event.partner}
    assert hits[1] == f"tree {thickest + 1}"
    assert hits.get(0) != hits[1]


def test_cameras_render_the_requested_parts_alone():
    with VectorizedSimulation(scenario(), 2, seeds=[5, 6], threads=2, worlds=WORLDS[:2]) as envs:
        camera = envs.sensors["uav1"]["camera"]
        camera.request_parts(["depth"])
        fly(envs, None)
        found = envs.sample("uav1", "camera")
        expected = [alone(5 + env, WORLDS[env], None)["camera.depth"] for env in range(2)]
        np.testing.assert_array_equal(found["depth"], expected)
        assert found["colour"].shape == (2, 0, 0)
        with pytest.raises(SensorError, match="some of colour, depth, labels"):
            camera.request_parts(["infrared"])
        with pytest.raises(SensorError, match="is no camera"):
            envs.sensors["uav1"]["imu"].request_parts(["depth"])


def test_a_reset_renders_the_image_of_its_own_environment_alone(monkeypatch):
    rendered = []
    monkeypatch.setattr(
        "volery.sensors.cameras.bank.take",
        lambda scene, model, light, batch, *rest, **options: (
            rendered.append(batch.uav.tolist())
            or take(scene, model, light, batch, *rest, **options)
        ),
    )
    with VectorizedSimulation(scenario(), 3, seeds=[5, 6, 7], threads=1) as envs:
        envs.run(envs.common_period_s)
        before = envs.sample("uav1", "camera")["colour"]
        rendered.clear()
        envs.reset([1], seeds=[8], start=START)
        assert rendered == [[1]]
        after = envs.sample("uav1", "camera")["colour"]
        np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])
        assert (after[1] != before[1]).any()
        envs.reset(seeds=[5, 8, 7], start=START)
        np.testing.assert_array_equal(envs.sample("uav1", "camera")["colour"][1], after[1])


def test_worlds_that_do_not_exist_are_refused(flown):
    with pytest.raises(CommandError, match="numbered 0 to 2"):
        flown.reset([0], worlds=[3])
    with pytest.raises(CommandError, match="2 environments need as many numbers of worlds"):
        flown.reset([0, 1], worlds=[0])
    with pytest.raises(ScenarioError, match="at least one seed"):
        VectorizedSimulation(scenario(), 1, worlds=[])
