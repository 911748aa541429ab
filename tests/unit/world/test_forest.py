import numpy as np
import pytest
from cpu_units import cpu_units

from volery.core.errors import DataFileError, ScenarioError
from volery.world.forest import Forest, forest_from_inventory, procedural_forest
from volery.world.terrain import Terrain
from volery.world.trees import DetailLevel

MIX = {"broadleaf": 0.6, "conifer": 0.2, "palm": 0.15, "snag": 0.05}
WEST = (0.0, 0.0, 500.0, 500.0)


@pytest.fixture(scope="module")
def hills(forest_data) -> Terrain:
    return Terrain.from_csv(forest_data / "bei_elevation.csv", 5.0)


@pytest.fixture(scope="module")
def bei(forest_data, hills) -> Forest:
    return forest_from_inventory(
        forest_data / "bei_trees.csv",
        species="beilschmiedia_pendula",
        terrain=hills,
        region=WEST,
        seed=1,
    )


def same(a: Forest, b: Forest) -> bool:
    arrays = ("position_map", "yaw", "scale", "dbh_m", "height_m")
    return all(getattr(a, n).tobytes() == getattr(b, n).tobytes() for n in arrays)


def exact_sizes(forest: Forest) -> None:
    """Trunk diameter and height of every placed tree are the forest's."""
    for k, (model, scale) in enumerate(
        zip([forest.models[i] for i in forest.model_index], forest.scale, strict=True)
    ):
        breast = min(1.3, 0.5 * forest.height_m[k]) / scale[2]
        radius = scale[0] * model.stem_radius(np.array([breast]))[0]
        assert 2.0 * radius == pytest.approx(forest.dbh_m[k])
        assert scale[2] * model.height_m == pytest.approx(forest.height_m[k])


def test_the_real_forest(bei, hills):
    assert len(bei) == 2052
    assert bei.position_map[:, 0].max() < 500.0
    x, y, z = bei.position_map.T
    np.testing.assert_allclose(z, hills.height(x, y))
    assert bei.dbh_m.min() >= 0.01
    assert bei.dbh_m.max() <= 0.9
    assert bei.height_m.max() > 25.0
    assert 0.15 < (bei.dbh_m > 0.1).mean() < 0.35
    assert bei.scale.min() > 0.45
    assert bei.scale.max() < 2.2
    assert len(bei.models) <= 15


def test_sizes_come_out_exactly(bei, forest_data):
    exact_sizes(bei)
    pines = forest_from_inventory(
        forest_data / "longleaf_trees.csv",
        species="longleaf_pine",
        terrain=Terrain.flat(200.0),
        seed=1,
    )
    exact_sizes(pines)
    assert len(pines) == 584
    assert pines.dbh_m[0] == pytest.approx(0.329)


def test_transforms_carry_models_onto_the_ground(bei):
    transforms = bei.tree_transforms()
    assert transforms.shape == (2052, 3, 4)
    assert transforms.dtype == np.float32
    k = int(bei.height_m.argmax())
    levels = bei.models[bei.model_index[k]].levels[DetailLevel.SENSING]
    tree, leaves = (m.transformed(transforms[k]) for m in (levels.wood, levels.leaves))
    foot = bei.position_map[k]
    top = max(tree.bounds[1, 2], leaves.bounds[1, 2])
    assert top == pytest.approx(foot[2] + bei.height_m[k], abs=1e-3)
    # no daylight below a trunk on the steepest slope of the plot
    assert tree.bounds[0, 2] < foot[2] - bei.dbh_m[k]


def test_a_tree_is_the_same_in_every_region(bei, forest_data, hills):
    small = forest_from_inventory(
        forest_data / "bei_trees.csv",
        species="beilschmiedia_pendula",
        terrain=hills,
        region=(100.0, 100.0, 300.0, 300.0),
        seed=1,
    )
    lookup = {
        tuple(p): (d, h) for p, d, h in zip(bei.position_map, bei.dbh_m, bei.height_m, strict=True)
    }
    for p, d, h in zip(small.position_map, small.dbh_m, small.height_m, strict=True):
        assert lookup[tuple(p)] == (d, h)


def test_the_seed_decides(forest_data, hills, bei):
    arguments = {"species": "beilschmiedia_pendula", "terrain": hills, "region": WEST}
    path = forest_data / "bei_trees.csv"
    assert same(forest_from_inventory(path, seed=1, **arguments), bei)
    assert not same(forest_from_inventory(path, seed=2, **arguments), bei)


def test_inventory_columns_win_over_laws(tmp_path):
    path = tmp_path / "trees.csv"
    path.write_text("x_m,y_m,dbh_cm,height_m,species\n5,5,30,12,snag\n9,9,20,,\n9,5,,8,palm\n")
    forest = forest_from_inventory(path, species="broadleaf", terrain=Terrain.flat(20.0), seed=4)
    assert forest.species == ("snag", "broadleaf", "palm")
    assert forest.dbh_m[:2].tolist() == [0.3, 0.2]
    assert forest.height_m[0] == 12.0
    assert forest.height_m[2] == 8.0
    exact_sizes(forest)
    assert [forest.models[k].species for k in forest.model_index] == list(forest.species)


def test_trees_lower_than_breast_height_stand_too(tmp_path):
    path = tmp_path / "trees.csv"
    path.write_text("x_m,y_m,dbh_cm,height_m\n5,5,1,0.8\n")
    forest = forest_from_inventory(path, species="longleaf_pine", terrain=Terrain.flat(20.0))
    exact_sizes(forest)


def test_census_sizes_can_be_asked_for(forest_data, hills):
    forest = forest_from_inventory(
        forest_data / "bei_trees.csv",
        species="beilschmiedia_pendula",
        terrain=hills,
        diameters="census",
    )
    assert len(forest) == 3604
    assert (forest.dbh_m > 0.1).mean() < 0.11


def test_a_procedural_forest_keeps_its_spacing():
    forests = []

    def grow():
        forests.append(
            procedural_forest(
                WEST, species=MIX, trees=5000, minimum_spacing_m=2.0, seed=1, terrain=Terrain.flat()
            )
        )

    assert cpu_units(grow) < 65.0  # 4.5 on the machine of the first measurement
    (forest,) = forests
    assert len(forest) == 5000
    exact_sizes(forest)
    x, y = forest.position_map[:, :2].T
    assert x.min() >= 0.0
    assert x.max() <= 500.0
    order = np.argsort(x)
    x, y = x[order], y[order]
    for shift in range(1, 60):
        assert np.hypot(x[shift:] - x[:-shift], y[shift:] - y[:-shift]).min() >= 2.0
    assert x[60:].min() >= 0.0
    fractions = {name: forest.species.count(name) / 5000 for name in MIX}
    assert fractions == pytest.approx(MIX, abs=0.03)


def test_density_and_equal_fractions():
    forest = procedural_forest(
        (0.0, 0.0, 100.0, 50.0),
        species=["palm", "snag"],
        density_per_ha=120.0,
        minimum_spacing_m=0.0,
        terrain=Terrain.flat(100.0),
        seed=2,
    )
    assert len(forest) == 60
    assert set(forest.species) == {"palm", "snag"}
    assert same(
        forest,
        procedural_forest(
            (0.0, 0.0, 100.0, 50.0),
            species=["palm", "snag"],
            trees=60,
            minimum_spacing_m=0.0,
            terrain=Terrain.flat(100.0),
            seed=2,
        ),
    )


def test_no_trees_is_a_forest_too():
    forest = procedural_forest(WEST, species="palm", trees=0, terrain=Terrain.flat())
    assert len(forest) == 0
    assert forest.tree_transforms().shape == (0, 3, 4)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"trees": 5000, "minimum_spacing_m": 20.0}, "of 5,000 trees fit"),
        ({"species": "oak"}, "unknown tree species 'oak'"),
        ({"species": {"palm": -1.0}}, "share of species 'palm'"),
        ({"species": {}}, "at least one species"),
        ({"trees": None}, "either trees or density_per_ha"),
        ({"trees": -1}, "must not be negative"),
        ({"region": (0.0, 0.0, 0.0, 5.0)}, "x0 < x1"),
        ({"diameters": "census"}, "no spread of diameters 'census'"),
    ],
)
def test_impossible_forests_are_refused(change, message):
    arguments = {"region": WEST, "species": "palm", "trees": 10, "terrain": Terrain.flat()} | change
    region = arguments.pop("region")
    with pytest.raises(ScenarioError, match=message):
        procedural_forest(region, **arguments)


def test_a_broken_inventory_makes_no_forest(tmp_path):
    path = tmp_path / "trees.csv"
    path.write_text("x_m,y_m\n1,2\n1,zwei\n")
    with pytest.raises(DataFileError, match="row 3"):
        forest_from_inventory(path, species="palm", terrain=Terrain.flat())
