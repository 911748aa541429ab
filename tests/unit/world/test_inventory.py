import numpy as np
import pytest

from volery.core.errors import DataFileError
from volery.world.inventory import read_inventory


def write(tmp_path, text):
    path = tmp_path / "trees.csv"
    path.write_text(text)
    return path


def test_reads_all_columns_and_leaves_gaps(tmp_path):
    text = "species,y_m,x_m,dbh_cm,height_m\nsnag,2,1,20,5\n,4,3,,\n\n"
    trees = read_inventory(write(tmp_path, text))
    assert trees.position.tolist() == [[1, 2], [3, 4]]
    assert trees.species == ("snag", "")
    assert trees.dbh_m[0] == pytest.approx(0.2)
    assert np.isnan(trees.dbh_m[1])
    assert np.isnan(trees.height_m[1])


def test_reads_what_ships(forest_data):
    bei = read_inventory(forest_data / "bei_trees.csv")
    assert len(bei) == 3604
    west = bei.within((0.0, 0.0, 500.0, 500.0))
    assert len(west) == 2052
    longleaf = read_inventory(forest_data / "longleaf_trees.csv")
    assert len(longleaf) == 584
    assert np.isfinite(longleaf.dbh_m).all()


@pytest.mark.parametrize(
    "text",
    [
        "x_m;y_m;dbh_cm;species\n1,5;2;30,5;oak\n3;4,25;NA;NA\n",  # a spreadsheet in German
        "x_m\ty_m\tdbh_cm\tspecies\n1.5\t2\t30.5\toak\n3\t4.25\t\t\n",
        ",x_m,y_m,dbh_cm,species\n0,1.5,2.0,30.5,oak\n1,3.0,4.25,,\n",  # pandas
        '"x_m","y_m","dbh_cm","species"\r\n1.5,2,30.5,"oak"\r\n3,4.25,NA,NA\r\n',  # R
    ],
)
def test_what_spreadsheets_pandas_and_r_write(tmp_path, text):
    path = tmp_path / "trees.csv"
    path.write_text(text, encoding="utf-8", newline="")
    trees = read_inventory(path)
    assert trees.position.tolist() == [[1.5, 2.0], [3.0, 4.25]]
    assert trees.dbh_m[0] == pytest.approx(0.305)
    assert np.isnan(trees.dbh_m[1])
    assert trees.species == ("oak", "")


def test_another_encoding_is_named(tmp_path):
    path = tmp_path / "trees.csv"
    path.write_text("x_m,y_m,species\n1,2,h\u00eatre\n", encoding="latin-1")
    with pytest.raises(DataFileError, match="not UTF-8; save it as CSV in UTF-8"):
        read_inventory(path)


def test_every_bad_row_is_listed_in_one_error(tmp_path):
    rows = [
        "x_m,y_m,dbh_cm,height_m,species",
        "1,1,10,5,broadleaf",
        "x,1,10,5,broadleaf",
        "1,nan,10,5,broadleaf",
        "1,1,-3,5,broadleaf",
        "1,1,10,0,broadleaf",
        "1,1,10",
        ",1,10,5,broadleaf",
        "1,1,9999,5,broadleaf",
    ]
    with pytest.raises(DataFileError) as caught:
        read_inventory(write(tmp_path, "\n".join(rows)))
    message = str(caught.value)
    assert "trees.csv has 7 bad rows" in message
    for part in (
        "row 3: x_m is not a number",
        "row 4: y_m nan is not finite",
        "row 5: dbh_cm -3 must be above 0",
        "row 6: height_m 0 must be above 0",
        "row 7: 3 fields, the heading has 5",
        "row 8: x_m is empty",
        "row 9: dbh_cm 9999 is above 1500",
    ):
        assert part in message


def test_beyond_twenty_bad_rows_only_their_numbers_are_told(tmp_path):
    with pytest.raises(
        DataFileError, match=r"has 50 bad rows: row 2: .*row 21: .*; and rows 22, 23, .*, 51$"
    ):
        read_inventory(write(tmp_path, "x_m,y_m\n" + "a,b\n" * 50))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        ("x_m,dbh_cm\n1,2\n", "column 'y_m' is missing"),
        ("x_m,y_m,dbh\n1,2,3\n", "row 1, column 3: unknown name 'dbh'"),
        ("x_m,y_m,x_m\n1,2,3\n", "column 'x_m' occurs twice"),
    ],
)
def test_broken_headings_say_what_is_allowed(tmp_path, text, message):
    with pytest.raises(DataFileError) as caught:
        read_inventory(write(tmp_path, text))
    assert message in str(caught.value)


def test_a_missing_inventory_is_named(tmp_path):
    with pytest.raises(DataFileError, match=r"none\.csv does not exist"):
        read_inventory(tmp_path / "none.csv")
