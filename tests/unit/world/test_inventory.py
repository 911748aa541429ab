import numpy as np
import pytest

from volery.core import text_tables
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
        "sep=;\r\nx_m;y_m;dbh_cm;species\r\n1,5;2;30,5;oak\r\n3;4,25;-;-\r\n",  # Excel
        "x_m,y_m,dbh_cm,species\r1.5,2,30.5,oak\r3,4.25,nan,nan\r",
        "# plot 7, 2021\n# by hand\nx_m|y_m|dbh_cm|species\n1.5|2|30.5|oak\n3|4.25||\n",
        "Tree ID,X (m),Y (m),DBH (mm),Species,Notes\n7,1.5,2,305,oak,a\n7,3,4.25,-9999,null,\n",
        "id,easting_m,Northing [m],dbh_in,SPECIES\n1,1.5,2,12.0078740157,oak\n2,3,4.25,N/A,n/a\n",
        "#;x_m;y_m;dbh_cm;species\n1;1,5;2;30,5;oak\n2;3;4,25;#NV;#NV\n",  # numbered rows
        "# plot 7\n# x_m y_m dbh_cm species\n1.5e0 2e0 3.05e1 oak\n3 4.25 nan nan\n",  # numpy
        '"x_m" "y_m" "dbh_cm" "species"\n"1" 1.5 2 30.5 "oak"\n"2" 3 4.25 NA NA\n',  # R
        '"x_m";"y_m";"dbh_cm";"species"\n"1";1,5;2;30,5;"oak"\n"2";3;4,25;NA;NA\n',  # R
        "x_m;y_m;dbh_cm;species\n1,5;2;30,5;oak;\n3;4,25;;;\n",
        '"# plot 7, 2021",,,\nx_m,y_m,dbh_cm, "species"\n1.5,2,30.5, "oak"\n3,4.25,,\n',
        "x_ft,y_ft,girth_cm,species\n4.92125984252,6.56167979003,95.8185759345,oak\n"
        "9.84251968504,13.9435695538,.,\n",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_what_spreadsheets_pandas_and_r_write(tmp_path, text, encoding):
    path = tmp_path / "trees.csv"
    path.write_text(text, encoding=encoding, newline="")
    trees = read_inventory(path)
    np.testing.assert_allclose(trees.position, [[1.5, 2.0], [3.0, 4.25]], rtol=1e-9)
    assert trees.dbh_m[0] == pytest.approx(0.305)
    assert np.isnan(trees.dbh_m[1])
    assert trees.species == ("oak", "")


@pytest.mark.parametrize(
    "mark",
    ["#N/A", "#VALUE!", "#DIV/0!", "#REF!", "#NAME?", "#NULL!", "#NUM!", "#SPILL!", "#WERT!",
     "#BEZUG!", "#NV", "#N/D", " #n/a "],
)  # fmt: skip
def test_errors_of_excel_are_not_measured(tmp_path, mark):
    text = f"dbh_cm,x_m,y_m,height_m,species\n{mark},1,2,{mark},{mark}\n20,3,4,5,oak\n"
    trees = read_inventory(write(tmp_path, text))
    assert trees.position.tolist() == [[1, 2], [3, 4]]
    np.testing.assert_array_equal(trees.dbh_m, [np.nan, 0.2])
    np.testing.assert_array_equal(trees.height_m, [np.nan, 5.0])
    assert trees.species == ("", "oak")


def test_feet_are_metres(tmp_path):
    trees = read_inventory(write(tmp_path, "x_m,y_m,Ht_ft,dbh_m\n1,2,50,0.5\n"))
    assert (trees.height_m[0], trees.dbh_m[0]) == pytest.approx((15.24, 0.5))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x_m;y_m;dbh_cm\n1,5;2;30,5\n1.432,5;2;3\n", "row 3: x_m is not a number, other rows have "
         "decimal commas: '1.432,5'"),
        ("x_m\ty_m\n1,234\t987.5\n", "row 2: y_m is not a number, other rows have decimal commas"),
        ("x_m,y_m,dbh_cm\n1,2,#12\n", "row 2: dbh_cm is not a number: '#12'"),
        ("x_m,y_m\n#REF!,2\n", "row 2: x_m is empty: '#REF!'"),
        ("x_m,y_m\n1,5,2\n3,4,2\n", "row 2: 3 fields, the heading has 2"),
        ('x_m,y_m\n"432,111.25",5\n', "row 2: x_m is not a number: '432,111.25'"),
        ("x_m,y_m\n1,2\n-9999,-9999\n", "row 3: x_m and y_m are -9999, which marks what is not"),
        ("x_m,y_m,dbh_cm\n1,2,3-Jan\n", "row 2: dbh_cm is not a number: '3-Jan'"),
        ("lat,lon,dbh_cm\n47,8,30\n", "row 1, column 1: unknown name 'lat': positions are x_m and"),
        ("x_m,y_m,DBH\n1,2,3\n", "row 1, column 3: unknown name 'DBH': it needs its unit"),
        ("x_m,y_m,dbh_cm,DBH (in)\n1,2,3,4\n", "column 'dbh_cm' occurs twice"),
    ],
)  # fmt: skip
def test_ambiguous_files_are_refused(tmp_path, text, message):
    with pytest.raises(DataFileError) as caught:
        read_inventory(write(tmp_path, text))
    assert message in str(caught.value)


def test_columns_that_are_not_read_are_named(tmp_path, caplog):
    text_tables._warn.cache_clear()
    read_inventory(write(tmp_path, "tree_id,x_m,y_m,dhb_cm\n1,2,3,4\n"))
    (record,) = caplog.records
    assert record.getMessage() == "inventory trees.csv: columns that are not read: tree_id, dhb_cm"


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
        "row 3: x_m is not a number: 'x'",
        "row 4: y_m is empty: 'nan'",
        "row 5: dbh_cm -3 must be above 0",
        "row 6: height_m 0 must be above 0",
        "row 7: 3 fields, the heading has 5",
        "row 8: x_m is empty",
        "row 9: dbh_cm 9999 is above 1500",
    ):
        assert part in message


def test_beyond_twenty_bad_rows_only_their_numbers_are_reported(tmp_path):
    with pytest.raises(
        DataFileError, match=r"has 50 bad rows: row 2: .*row 21: .*; and rows 22, 23, .*, 51$"
    ):
        read_inventory(write(tmp_path, "x_m,y_m\n" + "a,b\n" * 50))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty"),
        (
            "gx,gy,dbh_mm\n1,2,3\n",
            "column 'x_m' is missing; the file has gx, gy; allowed: x_m, y_m",
        ),
        ("PK\x03\x04", "is a spreadsheet; save it as CSV in UTF-8"),
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
