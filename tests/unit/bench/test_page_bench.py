"""Parts of the bench `page` that need no browser."""

import pytest

from volery.scenario.load import load_scenario
from volery_benchmarks.page.streams import lost
from volery_benchmarks.page.worlds import crowd, forest

PERIOD_NS = 33_000_000


def test_lost_messages_are_gaps_between_stamps():
    stamps = [k * PERIOD_NS for k in range(100)]
    assert lost(stamps) == 0
    assert lost([s for k, s in enumerate(stamps) if k not in (40, 41, 70)]) == 3
    assert lost([]) == lost([5]) == 0


@pytest.mark.parametrize("uavs", [1, 10, 50, 256])
def test_a_crowd_has_so_many_uavs_apart_from_each_other(tmp_path, uavs):
    path = tmp_path / "crowd.toml"
    path.write_text(crowd(uavs))
    groups = load_scenario(path).uavs
    assert sum(group.count for group in groups) == uavs
    assert len({group.position_m[1] for group in groups}) == len(groups)


def test_the_forest_has_its_trees(tmp_path):
    path = tmp_path / "forest.toml"
    path.write_text(forest())
    assert load_scenario(path).world.forest.trees == 5000
