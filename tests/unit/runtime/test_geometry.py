"""What stands in a world has a name, which changes when something else stands there."""

from dataclasses import replace

import numpy as np
import pytest

from volery import Simulation, load_scenario
from volery.runtime.construction.geometry import Geometry
from volery.runtime.construction.world_asset import kind_of
from volery.scenario import overrides
from volery.world.forest import procedural_forest
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.scene_content import Look, Solid
from volery.world.terrain import Terrain


def terrain(height=0.0):
    return Terrain.flat(100.0, height, origin=(-50.0, -50.0))


def forest(seed=1):
    return procedural_forest(
        (-20.0, -20.0, 20.0, 20.0), species=["snag"], trees=5, terrain=terrain(), seed=seed
    )


def solid(shift=0.0, **changes):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    corners[:, 0] += shift
    mesh = Mesh(corners.astype(np.float32), np.array([[0, 2, 1], [0, 1, 3]], np.uint32))
    return replace(Solid(mesh, Material.WALL, "wall"), **changes)


def test_equal_worlds_have_the_same_name():
    made = [Geometry(terrain(), forest(), (solid(),)).id for _ in range(2)]
    assert made[0] == made[1]
    assert len(made[0]) == 24
    int(made[0], 16)


def test_different_worlds_have_different_names():
    names = [
        Geometry(terrain()).id,
        Geometry(terrain(1.0)).id,
        Geometry(terrain(), forest()).id,
        Geometry(terrain(), forest(2)).id,
        Geometry(terrain(), None, (solid(),)).id,
        Geometry(terrain(), None, (solid(0.001),)).id,
        Geometry(terrain(), None, (solid(material=Material.BLOCK),)).id,
        Geometry(terrain(), None, (solid(look=Look((0.5, 0.5, 0.5))),)).id,
        Geometry(terrain(), None, (solid(), solid())).id,
    ]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("hover", "open"),
        ("grid_map", "grid_map"),
        ("forest_survey", "forest"),
        ("city_flight", "city"),
    ],
)
def test_kinds_of_worlds(name, kind):
    assert kind_of(load_scenario(name)) == kind


def test_the_name_is_published_when_blocks_change_and_after_a_restore():
    scenario = overrides.apply(load_scenario("grid_map"), uavs=None, seconds=5.0, seed=None)
    ids = []
    with Simulation(scenario, threads=1) as simulation:
        simulation.graph.subscribe("/volery/world", lambda p: ids.append(p.message.data))
        simulation.step(2)
        first = simulation.geometry
        assert ids == [first.id]
        kept = simulation.snapshot()
        simulation.world.grid_map.change(block_height_m=9.0)
        simulation.step(2)
        assert simulation.geometry.id != first.id
        assert ids == [first.id, simulation.geometry.id]
        simulation.world.grid_map.change(block_height_m=9.0)  # nothing else stands there
        simulation.step(2)
        assert len(ids) == 2
        simulation.restore(kept)
        simulation.step(2)
        assert simulation.geometry.id == first.id
        assert ids[-1] == first.id
