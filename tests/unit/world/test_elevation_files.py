"""Grids of elevations as programs write them, and what is refused with row and column."""

import numpy as np
import pytest

from volery.core.errors import DataFileError
from volery.world.elevation_files import read_elevations

HEIGHTS = [[1.5, 2.0, -3.25], [4.0, 0.0, 6.0]]
ESRI = "NCOLS 3\nnrows 2\nxllcorner 432100.5\nyllcorner 5411200\ncellsize 5\nNODATA_value -7\n"


@pytest.fixture
def read(tmp_path):
    """Read a file of this content; its spacing is 5 m."""

    def read(content):
        path = tmp_path / "grid.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_elevations(path, 5.0)

    return read


@pytest.mark.parametrize(
    "content",
    [
        "1.5,2.0,-3.25\n4,0,6\n",
        b"\xef\xbb\xbf1.5,2.0,-3.25\r\n4,0,6\r\n",
        "1.5, 2.0, -3.25,\n4,0,6,\n",
        "1,5;2,0;-3,25\n4;0;6\n",
        "1.5;2.0;-3.25;\n4;0;6;\n",
        "1.5\t2.0\t-3.25\n4\t0\t6\n",
        " 1.5e0  2 -3.25\n\n 4 0 6 \n\n",
        ESRI + "4 0 6\n1.5 2 -3.25\n",  # from north to south
        ESRI + "4 0 6 1.5\n2 -3.25\n",  # lines of any length
        ESRI + "4\n0\n6\n1.5\n2\n-3.25\n",
        ESRI + "4 0 6 1.5 2 -3.25\n",
        ESRI.replace("00.5", "00,5").replace(" 5\n", " 5,0\n") + "4 0 6\n1,5 2 -3,25\n",
        ESRI.replace("cellsize 5", "DX 5.0\nDY 5.0").replace("-7", "nan") + "4 0 6\n1.5 2 -3.25\n",
        ESRI.replace("corner", "center") + " 4  0 6 \r\n 1.5 2 -3.25 \r\n",
        "1.5,2.0,-3.25\r\n4,0,6\r\n".encode("utf-16"),  # PowerShell
        "sep=;\r\n1,5;2,0;-3,25\r\n4;0;6\r\n",  # Excel
        "# DEM of plot 7; in m\n1.5 2 -3.25\n# a line between\n4 0 6\n#\n",  # numpy
        '"1.5","2.0","-3.25"\n"4","0","6"\n',
        '"1,5";"2,0";"-3,25"\n"4";"0";"6"\n',
        '"1.5", "2", "-3.25"\n4, 0, 6\n',
        "1,5\t2,0\t-3,25\n4\t0\t6\n",
        "1,5 2,0 -3,25\n4 0 6\n",
        "1.5,\t2,\t-3.25\n4,\t0,\t6\n",
        "1.5|2|-3.25|\n4|0|6|\n",
        "# of GRASS\n" + ESRI + "4 0 6\n1.5 2 -3.25\n",
    ],
)
def test_matrices_and_esri_grids(read, content):
    np.testing.assert_array_equal(read(content), HEIGHTS)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("1,2\n3,-9999\n", r"row 2, column 2: -9999 marks a place without data"),
        ("1,-32768\n3,4\n", r"row 1, column 2: -32768 marks a place without data"),
        ("1,2\n3.4028235e38,4\n", r"row 2, column 1: 3\.40282e\+38 is no elevation in m"),
        ("412000,2\n3,4\n", r"row 1, column 1: 412000 is no elevation in m"),
        ("1,2\n-12500,4\n", r"row 2, column 1: -12500 is no elevation"),
        ("1,2\n3,x\n", r"row 2, column 2: not a number"),
        ("1,2\n3,nan\n", r"row 2, column 2: nan marks a place without data"),
        ("#VALUE!,2\n3,4\n", r"row 1, column 1: nan marks a place without data"),
        ("1;2\n3;#N/A\n", r"row 2, column 2: nan marks a place without data"),
        ("# a\nsep=;\n1;2\n3;x\n", r"row 4, column 2: not a number"),
        ('"1,5","2"\n"3","4"\n', r"row 1, column 1: not a number"),
        ("1\t\t2\n3\t4\t5\n", r"row 1, column 2: not a number"),
        ('"' + "1" * 200_000 + '",2\n', r"row 1: field larger than field limit"),
        ("1,2\n3,inf\n", r"row 2, column 2: not finite"),
        (ESRI.replace("-7", "null") + "4 0 6\n1.5 null 3\n", r"row 8, column 2: nan marks a place"),
        (ESRI.replace("cellsize 5", "dx 5\ndy 4"), r"its dy is 4, spacing_m is 5"),
        (ESRI + "4 0\n6 1.5 2 x\n", r"row 8, column 4: not a number"),
        (b"II*\0" + bytes(80), r"is a GeoTIFF; `gdal_translate -of AAIGrid` writes"),
        (b"\xff\xd8\xff\xe0", "is not text in UTF-8"),
        ("0,0,7\n0,5,7\n5,0,8\n5,5,9\n", "is a list of x y z"),
        ("1,2\n3\n", r"row 2 has 1 value, the first row 2"),
        ("x,y,z\n0,0,1\n", r"row 1, column 1: not a number"),
        (ESRI + "4 0 6\n1.5 2 -7\n", r"row 8, column 3: -7 marks a place without data"),
        (ESRI + "4 0 6\n", r"has 1 row"),
        (ESRI + "4 0 6\n1 2 3\n4 5 6\n", r"nrows is 2; it has 3 rows"),
        (ESRI + "4 0\n1 2\n", r"ncols is 3; it has 2 values"),
        (ESRI.replace("cellsize 5", "cellsize 2"), r"its cellsize is 2, spacing_m is 5"),
        (ESRI.replace("cellsize 5", "cellsize"), r"row 5: 'cellsize' needs a number"),
    ],
)
def test_what_is_no_elevation_is_refused_with_row_and_column(read, content, message):
    with pytest.raises(DataFileError, match=message):
        read(content)
