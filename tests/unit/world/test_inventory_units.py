"""Numbers that are most likely in another unit are questioned, once, and read as they are."""

import logging

import pytest

from volery.world import inventory
from volery.world.inventory import read_inventory


@pytest.fixture
def doubts(tmp_path, caplog):
    """Read rows below the columns x_m,y_m,dbh_cm,height_m; returns the warnings."""

    def read(*rows):
        inventory._warn.cache_clear()
        path = tmp_path / "trees.csv"
        path.write_text("\n".join(["x_m,y_m,dbh_cm,height_m", *rows]))
        with caplog.at_level(logging.WARNING):
            for _ in range(2):
                assert len(read_inventory(path)) == len(rows)
        return [record.getMessage() for record in caplog.records]

    return read


@pytest.mark.parametrize(
    ("rows", "warning"),
    [
        (("0,0,30,20", "5,9,0.55,18", "9,9,0.4,"), r"row 3: dbh_cm is 0.55, with a height of 18 m"
         "; is it in m? (2 trees of 3)"),
        (("0,0,0.3,", "5,9,25,9"), "row 2: dbh_cm is 0.3; is it in m? (1 tree of 2)"),
        (("0,0,1.1,25", "5,9,,"), "row 2: dbh_cm is 1.1, with a height of 25 m; is it in m?"
         " (1 tree of 2)"),
        (("0,0,550,21",), "row 2: dbh_cm is 550, with a height of 21 m; is it in mm?"
         " (1 tree of 1)"),
        (("0,0,30,20", "5,9,25,18", "0,0,30,20"), "row 4 repeats a row above it; does the file "
         "hold trees twice? (1 tree of 3)"),
        (("7.1,46.2,30,20", "7.1002,46.2001,30,"), "all 2 trees are within 1 m; are x_m and y_m"
         " in degrees?"),
    ],
)  # fmt: skip
def test_another_unit_is_questioned(doubts, rows, warning):
    assert doubts(*rows) == [f"inventory trees.csv: {warning}"]


def test_usual_trees_are_not(doubts):
    assert doubts("0,0,1,2.5", "5,5,390,80", "9,9,,", "9,8,30,20", "7,7,10,", "7,7,12,") == []
    assert doubts("7.1,46.2,30,20") == []
