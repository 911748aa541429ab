import logging

import pytest

from volery.core.errors import ScenarioError
from volery.runtime.construction.worlds import build_forest, build_terrain
from volery.scenario.load import load_scenario
from volery.world import species_map

SCENARIO = """
name = "oaks"
[types.scout]
[[uavs]]
type = "scout"
position_m = [0, 0]
[world.forest]
kind = "inventory"
file = "oaks.csv"
species = "broadleaf"
"""
SPECIES = [
    *["Quercus alba"] * 40,
    *["Acer rubrum"] * 3,
    *["Beilschmiedia  Pendula"] * 2,
    *[f"Rara avis{k}" for k in range(12)],
    "conifer",
    "",
]


@pytest.fixture
def forest_of(tmp_path):
    def forest(more="", species=SPECIES):
        rows = "".join(f"{k},0,20,9,{name}\n" for k, name in enumerate(species))
        (tmp_path / "oaks.csv").write_text("x_m,y_m,dbh_cm,height_m,species\n" + rows)
        (tmp_path / "oaks.toml").write_text(SCENARIO + more)
        scenario = load_scenario(tmp_path / "oaks.toml")
        return build_forest(scenario, build_terrain(scenario))

    species_map._warn.cache_clear()
    return forest


def test_unknown_species_stand_as_the_scenarios_and_are_counted_in_one_line(forest_of, caplog):
    forest = forest_of()
    assert forest.species == (
        *["broadleaf"] * 43,
        *["beilschmiedia_pendula"] * 2,
        *["broadleaf"] * 12,
        "conifer",
        "broadleaf",
    )
    [record] = caplog.records
    assert record.levelno == logging.WARNING
    assert record.getMessage() == (
        "inventory oaks.csv: 55 trees of 14 species that are not known (Quercus alba 40, "
        "Acer rubrum 3, Rara avis0 1, Rara avis1 1, Rara avis2 1, ...) become broadleaf; "
        "map them in [world.forest.species_map]"
    )
    forest_of()
    assert len(caplog.records) == 1


def test_a_map_says_which_shipped_species_they_are(forest_of, caplog):
    forest = forest_of(
        '[world.forest.species_map]\n"quercus alba" = "snag"\n"Acer rubrum" = "palm"\n'
        'conifer = "longleaf_pine"\n',
        ["Quercus alba", "Acer rubrum", "conifer", "palm"],
    )
    assert forest.species == ("snag", "palm", "longleaf_pine", "palm")
    assert not caplog.records


def test_names_in_the_map_that_no_tree_has_are_reported(forest_of, caplog):
    forest_of('[world.forest.species_map]\n"Querqus alba" = "snag"\n', ["conifer"])
    assert [record.getMessage() for record in caplog.records] == [
        "inventory oaks.csv: no tree is of the species Querqus alba in [world.forest.species_map]"
    ]


def test_targets_that_do_not_ship_are_refused_with_those_that_do(forest_of):
    with pytest.raises(ScenarioError) as caught:
        forest_of('[world.forest.species_map]\n"Quercus alba" = "broadleav"\n')
    assert str(caught.value) == (
        "oaks: world.forest: species_map.'Quercus alba': unknown tree species 'broadleav'; did you "
        "mean 'broadleaf'? Allowed: beilschmiedia_pendula, broadleaf, conifer, longleaf_pine, "
        "palm, snag"
    )


def test_names_are_shown_short_and_without_control_characters(forest_of, caplog):
    forest_of(species=["\x1b[31m" + "x" * 1000])
    [record] = caplog.records
    assert f"(?[31m{'x' * 35}... 1) become" in record.getMessage()
