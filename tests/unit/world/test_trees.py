import numpy as np
import pytest
from cpu_units import cpu_units
from rays_through import gap_fractions

from volery.core.errors import ScenarioError
from volery.world.trees import (
    DetailLevel,
    TreeModel,
    grow_model,
    grow_models,
    load_species,
    species_names,
)

LEAFY = [name for name in species_names() if load_species(name).leaf is not None]


def cross_section(mesh, height: float) -> float:
    """Area that a level plane cuts out of a closed tube."""
    corners = mesh.corners.astype(np.float64)
    above = corners[:, :, 2] > height
    area = 0.0
    for triangle, up in zip(corners, above, strict=True):
        if up.all() or not up.any():
            continue
        cuts = []
        for a, b in ((0, 1), (1, 2), (2, 0)):
            if up[a] != up[b]:
                t = (height - triangle[a, 2]) / (triangle[b, 2] - triangle[a, 2])
                cuts.append((triangle[a] + t * (triangle[b] - triangle[a]))[:2])
        # order the two ends so that the outside lies to the right
        outward = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])[:2]
        p, q = cuts
        if outward @ np.array([(q - p)[1], -(q - p)[0]]) < 0:
            p, q = q, p
        area += 0.5 * (p[0] * q[1] - p[1] * q[0])
    return area


@pytest.mark.parametrize("name", species_names())
def test_sizes_are_as_stated_at_every_level(name):
    species = load_species(name)
    for model in grow_models(species, seed=3):
        assert model.height_m > 0.5
        for level in DetailLevel:
            tree = model.levels[level]
            tops = [m.bounds[1, 2] for m in (tree.wood, tree.leaves) if len(m)]
            assert max(tops) == pytest.approx(model.height_m, rel=1e-6)
            assert np.isfinite(tree.wood.vertices).all()
            assert np.isfinite(tree.leaves.vertices).all()
            # roots reach below the foot, for slopes
            assert tree.wood.bounds[0, 2] < -1.5 * model.dbh_m


@pytest.mark.parametrize("name", ["beilschmiedia_pendula", "longleaf_pine", "palm", "snag"])
@pytest.mark.parametrize("level", list(DetailLevel))
def test_the_trunk_has_its_diameter_at_breast_height(name, level):
    species = load_species(name)
    model = grow_model(species, len(species.size_classes_cm) - 1, 0, seed=1)
    area = cross_section(model.levels[level].wood, 1.3)
    assert 2.0 * np.sqrt(area / np.pi) == pytest.approx(model.dbh_m, rel=0.02)
    assert 2.0 * model.stem_radius(np.array([1.3]))[0] == pytest.approx(model.dbh_m)


@pytest.mark.parametrize("name", LEAFY)
def test_crowns_have_the_width_of_the_law(name):
    species = load_species(name)
    for model in grow_models(species, seed=5):
        leaves = model.levels[DetailLevel.VISUAL].leaves.vertices[:, :2]
        radii = np.linalg.norm(leaves - np.median(leaves, axis=0), axis=1)
        law = species.crown_width.radius(model.dbh_m)
        assert 0.6 * law < np.percentile(radii, 90) < 1.5 * law


@pytest.mark.parametrize("name", LEAFY)
def test_coarser_levels_let_as_many_rays_through(name):
    species = load_species(name)
    variants = species.variants
    models = grow_models(species, seed=2)
    for size_class in range(len(species.size_classes_cm)):
        shapes: tuple[TreeModel, ...] = models[size_class * variants : (size_class + 1) * variants]
        gaps = {
            level: np.mean([gap_fractions(m, level) for m in shapes], axis=0)
            for level in DetailLevel
        }
        visual = gaps[DetailLevel.VISUAL]
        # real foliage has gaps, and is not empty
        assert 0.2 < visual[0] < 0.92
        np.testing.assert_allclose(gaps[DetailLevel.SENSING], visual, atol=0.05)
        np.testing.assert_allclose(gaps[DetailLevel.COARSE], visual, atol=0.08)


@pytest.mark.parametrize("name", LEAFY)
def test_levels_shrink(name):
    species = load_species(name)
    mature = grow_model(species, len(species.size_classes_cm) - 1, 0, seed=1)
    levels = [mature.levels[level] for level in DetailLevel]
    counts = [len(mesh.wood) + len(mesh.leaves) for mesh in levels]
    assert 5_000 < counts[0] < 70_000
    assert counts[1] < 4_000
    assert counts[2] < 0.8 * counts[1]
    assert len(mature.levels[DetailLevel.SENSING].leaves) <= 2_000


def test_there_is_room_to_fly_below_a_mature_crown():
    species = load_species("beilschmiedia_pendula")
    mature = grow_model(species, len(species.size_classes_cm) - 1, 0, seed=1)
    tree = mature.levels[DetailLevel.SENSING]
    assert tree.leaves.vertices[:, 2].min() > 6.0
    low = tree.wood.vertices[tree.wood.vertices[:, 2] < 5.0]
    assert np.linalg.norm(low[:, :2], axis=1).max() < 2.0


def test_the_seed_decides_and_the_order_of_asking_does_not():
    species = load_species("conifer")
    first, second = (grow_model(species, 1, 1, seed=7) for _ in range(2))
    for level in DetailLevel:
        first.levels[level]
    for level in reversed(list(DetailLevel)):
        for part in ("wood", "leaves"):
            a, b = (getattr(m.levels[level], part) for m in (first, second))
            assert a.vertices.tobytes() == b.vertices.tobytes()
            assert a.triangles.tobytes() == b.triangles.tobytes()
    other = grow_model(species, 1, 1, seed=8).levels[DetailLevel.SENSING]
    assert (
        other.leaves.vertices.tobytes()
        != first.levels[DetailLevel.SENSING].leaves.vertices.tobytes()
    )
    assert len(first.levels) == 3


def test_a_set_of_models_grows_quickly():
    species = load_species("beilschmiedia_pendula")
    meshes = []

    def grow():
        meshes.extend(model.levels[DetailLevel.SENSING] for model in grow_models(species, seed=1))

    assert cpu_units(grow) < 40.0  # 2.5 on the machine of the first measurement
    assert meshes
    for mesh in meshes:
        assert len(mesh.wood) + len(mesh.leaves) > 100


def test_heights_follow_their_sources():
    # Martinez Cano et al. 2019: 57.6 D^0.74 / (21.6 + D^0.74)
    law = load_species("beilschmiedia_pendula").height
    assert law.height(np.array([0.30]))[0] == pytest.approx(21.0, abs=0.1)
    # Chave et al. 2014 with E = 0
    law = load_species("broadleaf").height
    assert law.height(np.array([0.30]))[0] == pytest.approx(21.9, abs=0.1)
    # Forest Vegetation Simulator, southern variant: inches and feet
    law = load_species("longleaf_pine").height
    feet = 4.5 + 98.56082813 * np.exp(-3.89930709 * 12.0**-0.86730393)
    assert law.height(np.array([12 * 0.0254]))[0] == pytest.approx(0.3048 * feet)


def test_diameters_are_spread_as_stated():
    spread = load_species("beilschmiedia_pendula").spread("census")
    drawn = spread.draw(np.random.default_rng(0), 40_000)
    assert drawn.min() >= 0.01
    assert drawn.max() <= 0.90
    assert (drawn >= 0.10).mean() == pytest.approx(294 / 3604, abs=0.006)


def test_unknown_names_list_the_known_ones():
    with pytest.raises(ScenarioError, match="unknown tree species 'oak'; known: beilschmiedia"):
        load_species("oak")
    with pytest.raises(ScenarioError, match="it has stand"):
        load_species("palm").spread("census")


@pytest.mark.parametrize("name", species_names())
def test_every_law_names_its_source(name):
    species = load_species(name)
    assert species.name == name
    parts = [species.height, species.crown_width, species.trunk, species.crown]
    parts += list(species.diameters.values())
    assert all(part.source for part in parts)
