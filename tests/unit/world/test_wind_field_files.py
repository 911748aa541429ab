"""Wind fields from files, and the messages about bad ones."""

import itertools

import numpy as np
import pytest

from volery.core import text_tables
from volery.core.errors import DataFileError
from volery.world.weather import WindField

HEADING = "x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s"
NODES = list(itertools.product((0.0, 10.0, 20.0), (5.0, 25.0), (0.0, 3.0)))
ROWS = [f"{x},{y},{z},{0.1 * x},{0.2 * y},{0.3 * z}" for x, y, z in NODES]


def written(tmp_path, rows, heading=HEADING):
    path = tmp_path / "wind.csv"
    path.write_text("\n".join([heading, *rows]) + "\n")
    return path


def check(field):
    assert field.origin_map == (0.0, 5.0, 0.0)
    assert field.spacing_m == (10.0, 20.0, 3.0)
    assert field.velocity_map.shape == (2, 2, 3, 3)
    for x, y, z in NODES:
        node = field.velocity_map[int(z / 3), int((y - 5) / 20), int(x / 10)]
        np.testing.assert_allclose(node, [0.1 * x, 0.2 * y, 0.3 * z])
    assert not field.velocity_map.flags.writeable


def test_csv_rows_and_columns_come_in_any_order(tmp_path):
    check(WindField.from_file(written(tmp_path, ROWS)))
    rows = [",".join(row.split(",")[::-1]) for row in [*ROWS[5:], "", *ROWS[:5]]]
    heading = ",".join(HEADING.split(",")[::-1])
    check(WindField.from_file(written(tmp_path, rows, heading)))


@pytest.mark.parametrize(
    ("separator", "heading"),
    [
        (";", HEADING),
        ("\t", HEADING),
        ("|", HEADING),
        (" ", HEADING),
        (" ", "# " + HEADING.replace(",", " ")),  # numpy.savetxt
        (" ", "# a valley\n#" + HEADING),
        (";", "sep=;\n# a valley, at noon\n" + HEADING.upper().replace(",", ";")),
        (";", "# " + HEADING.replace(",", "; ")),
        ("\t", '"X (m)"\t"Y (m)"\t"Z (m)"\t"Vx (m/s)"\t"Vy (m/s)"\t"Vz (m/s)"'),
        (";", "X [m];Y [m];Z [m];vx [m/s];vy [m/s];vz [m/s]"),
    ],
)
@pytest.mark.parametrize("mark", [".", ","])
@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_csv_as_spreadsheets_and_numpy_write_it(tmp_path, separator, heading, mark, encoding):
    rows = [row.replace(",", separator).replace(".", mark) for row in ROWS]
    heading = heading.replace(",", separator) if heading == HEADING else heading
    path = tmp_path / "WIND.TXT"
    path.write_text("\r\n".join([heading, *rows, ""]), encoding=encoding, newline="")
    check(WindField.from_file(path))


def test_further_columns_of_a_csv_are_named(tmp_path, caplog):
    text_tables._warn.cache_clear()
    rows = [f"{k},{row},7.5" for k, row in enumerate(ROWS)]
    check(WindField.from_file(written(tmp_path, rows, f",{HEADING},k_m2_s2")))
    (record,) = caplog.records
    assert record.getMessage() == "wind field wind.csv: columns that are not read: k_m2_s2"


def test_rounded_coordinates_pass(tmp_path):
    rows = [f"{x:.3f},0,0,1,0,0" for x in np.arange(7) / 3.0]
    field = WindField.from_file(written(tmp_path, rows))
    assert field.spacing_m[0] == pytest.approx(1.0 / 3.0)
    assert field.velocity_map.shape == (1, 1, 7, 3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({3: "10,5,0,x,0,0"}, ["row 5", "vx_m_s is not a number"]),
        ({3: "10,5,0,1,0"}, ["row 5", "5 fields, the heading has 6"]),
        ({3: "10,5,0,nan,0,0"}, ["row 5", "vx_m_s is empty: 'nan'"]),
        ({3: "10,5,0,0,0,61"}, ["row 5", "vz_m_s 61", "60"]),
        ({4: "13,5,0,0,0,0"}, ["row 6", "x_m 13", "not on the grid 0, 10, 20"]),
        ({4: ROWS[0]}, ["row 6 repeats the node of row 2"]),
        ({4: ""}, ["11 of the 12 nodes", "(10, 5, 0)"]),
        ({1: "0,5,3,?,0,0", 7: "0,0,0,0,0,-99"}, ["row 3", "row 9"]),
    ],
)
def test_bad_rows_are_reported(tmp_path, change, words):
    rows = [change.get(k, row) for k, row in enumerate(ROWS)]
    with pytest.raises(DataFileError) as error:
        WindField.from_file(written(tmp_path, rows))
    for word in ["wind.csv", *words]:
        assert word in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("rows", "heading", "words"),
    [
        ([], HEADING, "no nodes"),
        (ROWS, "x,y,z,u,v,w", "row 1 must name the columns x_m.*, not x, y, z, u, v, w"),
        (ROWS, HEADING.replace("y_m", "X_M"), "row 1 must name the columns x_m"),
        (["1,5;0;0;1.5;0;0"], HEADING.replace(",", ";"), "row 2: vx_m_s is not a number: '1.5'"),
        (
            [f"{x},0,0,1,0,0" for x in (0, 10, 25)],
            HEADING,
            "x_m must be evenly spaced, not 0, 10, 25",
        ),
        ([f"{k},{k},{k},1,0,0" for k in range(3000)], HEADING, "3000 of the 27000000000 nodes"),
    ],
)
def test_bad_tables_are_reported(tmp_path, rows, heading, words):
    with pytest.raises(DataFileError, match=words):
        WindField.from_file(written(tmp_path, rows, heading))


def test_other_files_are_refused(tmp_path):
    with pytest.raises(DataFileError, match="does not exist"):
        WindField.from_file(tmp_path / "none.csv")
    (tmp_path / "wind.nc").touch()
    with pytest.raises(DataFileError, match=r"\.csv or an \.npz"):
        WindField.from_file(tmp_path / "wind.nc")
    (tmp_path / "wind.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataFileError, match="is not UTF-8; save it as CSV in UTF-8"):
        WindField.from_file(tmp_path / "wind.csv")


def archive(tmp_path, **changes):
    grid = WindField.from_file(written(tmp_path, ROWS))
    held = {
        "velocity_m_s": grid.velocity_map,
        "origin_m": grid.origin_map,
        "spacing_m": grid.spacing_m,
    }
    path = tmp_path / "wind.npz"
    np.savez(path, **{k: v for k, v in (held | changes).items() if v is not None})
    return path


def test_npz_holds_the_same(tmp_path):
    check(WindField.from_file(archive(tmp_path)))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"spacing_m": None}, r"must hold .*spacing_m \(3,\)"),
        ({"velocity_m_s": np.zeros((2, 2, 3))}, r"\(2, 2, 3\), not \(Z, Y, X, 3\)"),
        ({"origin_m": np.zeros(2)}, r"origin_m has shape \(2,\)"),
        ({"spacing_m": np.array([1.0, -1, 1])}, "spacing_m must be above 0"),
        ({"velocity_m_s": np.full((1, 1, 1, 3), np.nan)}, r"velocity_m_s\[0, 0, 0, 0\] = nan"),
        ({"velocity_m_s": np.array([{}])}, "cannot be read"),
    ],
)
def test_bad_archives_are_reported(tmp_path, changes, words):
    with pytest.raises(DataFileError, match=words):
        WindField.from_file(archive(tmp_path, **changes))


def test_a_broken_archive_is_reported(tmp_path):
    path = tmp_path / "wind.npz"
    path.write_bytes(b"PK\x03\x04 and nothing else")
    with pytest.raises(DataFileError, match=r"wind\.npz cannot be read"):
        WindField.from_file(path)
