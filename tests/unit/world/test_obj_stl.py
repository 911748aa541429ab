"""OBJ and STL as programs write them: every index, face, ending and byte order mark."""

import re
import struct

import numpy as np
import pytest
import trimesh

from volery.core.errors import DataFileError, ScenarioError
from volery.runtime.construction.user_meshes import mesh_solids
from volery.runtime.construction.worlds import geometry_of
from volery.scenario.load import parse_scenario
from volery.world.mesh_files import read_mesh

SQUARE = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n"


@pytest.fixture
def read(tmp_path):
    """Read a file of this content."""

    def read(content, name="a.obj"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return read_mesh(path)

    return read


# ------------------------------------------------------------------------------------------ obj


def test_a_gate_in_a_concave_wall_is_open(read):
    file = read("v -3 0 0\nv -1 0 0\nv -1 0 2\nv 1 0 2\nv 1 0 0\nv 3 0 0\nv 3 0 3\nv -3 0 3\n"
                "f 1 2 3 4 5 6 7 8\n")  # fmt: skip
    assert file.mesh.area == pytest.approx(14.0)


def test_negative_indices_count_back_from_their_face(read):
    near = "v -3 3 -1\nv 3 3 -1\nv 0 3 5\nf -3 -2 -1\n"
    file = read(near + near.replace(" 3 ", " 6 ", 1) + "f -6//-1 2 -1\n")
    np.testing.assert_array_equal(file.triangles, [[0, 1, 2], [3, 4, 5], [0, 1, 5]])


@pytest.mark.parametrize(
    "text",
    [
        SQUARE + "f 1 2 3 4 # a comment\n",
        SQUARE + "f 1/1/1 2/2/1 3//1 4/4\n",
        SQUARE + "f 1 2 \\\n  3 \\\n 4\n",
        SQUARE + "f 1 2 \\ \r\n  3 4\n",  # a blank after the backslash
        SQUARE + "f 1 1 2 3 3 4 1\n",  # repeated corners, a closed ring
        SQUARE + "fo 1 2 3 4\n",
        SQUARE.replace(" ", "\t") + "f\t1\t2\t3\t4",
        (SQUARE + "f 1 2 3 4\n").replace("\n", "\r"),
        (SQUARE + "f 1 2 3 4\n").replace("\n", "\r\n"),
        "f 1 2 3 4\n" + SQUARE,
        SQUARE.replace(" 0\n", " 0 0.2 0.4 0.6\n") + "f 1 2 3 4\n",  # colours of vertices
        SQUARE.replace(" 0\n", " 0 1.0\n") + "f 1 2 3 4\n",  # weights
        SQUARE + "g f 1 2 9\no f\nf 1 2 3 4\nl 1 2 3\np 1\nf 1 2\nf\n",
        b"\xef\xbb\xbf" + SQUARE.encode() + b"f 1 2 3 4\n",
        b"# W\xe4nde\ng W\xe4nde\n" + SQUARE.encode() + b"f 1 2 3 4\n",  # Latin-1
    ],
)
def test_faces_as_programs_write_them(read, text):
    file = read(text)
    assert file.mesh.area == pytest.approx(4.0)
    np.testing.assert_allclose(file.mesh.bounds, [[0, 0, 0], [2, 2, 0]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SQUARE + "f 1 2 9\n", r"line 5: a face has vertex 9; the file has 4"),
        (SQUARE + "f 1 2 3\nf 1 2 -5\n", r"line 6: 'f 1 2 -5'.* back to -4"),
        (SQUARE + "f 0 1 2\n", r"line 5: 'f 0 1 2'"),
        (SQUARE + "f 1 2 x\n", r"line 5: 'f 1 2 x'"),
        (
            "v 0,5 0 0\n" + SQUARE + "f 1 2 3\n",
            r"line 1: 'v 0,5 0 0'; a vertex needs three numbers with",
        ),
        ("v 0 0\n", r"line 1: 'v 0 0'"),
        (SQUARE.encode("utf-16"), "it is text in UTF-16; save it as UTF-8"),
    ],
)
def test_broken_faces_are_refused_with_their_line(read, text, message):
    with pytest.raises(DataFileError, match=message):
        read(text)


def test_materials_next_to_the_file_colour_the_largest_part(read, tmp_path):
    (tmp_path / "two paints.mtl").write_bytes(
        b"\xef\xbb\xbfnewmtl red one\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\nnewmtl odd\nKd spectral x\n"
    )
    text = "mtllib two paints.mtl\n" + SQUARE
    assert read(text + "usemtl red one\nf 1 2 3 4\nusemtl blue\nf 1 2 3\n").colour == (1, 0, 0)
    assert read(text + "usemtl red one\nf 1 2 3\nusemtl blue\nf 1 2 3 4\n").colour == (0, 0, 1)
    assert read(text + "usemtl odd\nf 1 2 3\n").colour == (0.5, 0.5, 0.5)
    assert read("mtllib ../a.mtl none.mtl\n" + SQUARE + "f 1 2 3\n").colour == (0.5, 0.5, 0.5)


# ------------------------------------------------------------------------------------------ stl


def facet(*corners):
    return struct.pack("<3f", 0, 0, 0) + struct.pack("<9f", *np.ravel(corners)) + bytes(2)


ONE = facet((0, 0, 0), (2, 0, 0), (0, 2, 0))
TWO = ONE + facet((0, 0, 1), (2, 0, 1), (0, 2, 1))


def binary(facets, count=None, head=b"probe"):
    count = len(facets) // 50 if count is None else count
    return head.ljust(80, b"\0") + struct.pack("<I", count) + facets


@pytest.mark.parametrize(
    ("content", "triangles"),
    [
        (binary(TWO), 2),
        (binary(TWO) + b"\r\n", 2),
        (binary(TWO) + bytes(300), 2),  # a block of an exporter
        (binary(ONE) + binary(TWO), 3),  # one file after another
        (binary(TWO, count=0), 2),  # written without going back to the header
        (binary(TWO, count=0xFFFFFFFF), 2),
        (binary(TWO, count=0x7FFFFFFF), 2),
        (binary(TWO, head=b"solid made by CAD"), 2),
        (binary(TWO, head=b"COLOR=\xff\x80\x00\xff,MATERIAL="), 2),
    ],
)
def test_binary_files_as_programs_write_them(read, content, triangles):
    file = read(content, "a.stl")
    assert len(file.triangles) == triangles
    assert file.mesh.area == pytest.approx(2.0 * triangles)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (binary(TWO)[:-1], r"announces 2 triangles, 184 bytes; it has 183"),
        (binary(ONE, count=7), r"announces 7 triangles, 434 bytes; it has 134"),
        (binary(ONE, count=0xFFFFFFFE), r"announces 4,294,967,294 triangles"),
        (binary(TWO, count=0xFFFFFFFF)[:-1], "it is cut off: its triangles of 50 bytes each"),
        (binary(TWO, count=0)[:-1], "it is cut off: its triangles of 50 bytes each"),
        (binary(b""), "without a triangle"),
        (bytes(20), "20 bytes are too few"),
        ("solid a\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n", "'endloop' is missing"),
        ("solid a\nouter loop\nvertex 0 0 0\nendloop\n", "line 4: a facet of 1 corners"),
        (
            "solid a\nouter loop\nvertex 0,5 0 0\n",
            "line 3: a vertex needs three numbers with decimal",
        ),
        ("solid a\nouter loop\nvertex 0 0\n", "line 3: a vertex needs three numbers$"),
        ("solid a\nouter loop\n".encode("utf-16"), "it is text in UTF-16; save it as UTF-8"),
    ],
)
def test_broken_stl_says_what_is_missing(read, content, message):
    with pytest.raises(DataFileError, match=message):
        read(content, "a.stl")


@pytest.mark.parametrize("ending", ["\n", "\r", "\r\n"])
def test_text_of_any_case_and_with_facets_of_four_corners(read, ending):
    lines = ["SOLID W\xe4nde", "FACET NORMAL nan nan nan", "OUTER LOOP", "VERTEX 0 0 0",
             "Vertex 2.0E+00 0 0", "vertex 2 2 0", "vertex 0 2 0", "ENDLOOP", "ENDFACET",
             "ENDSOLID", "solid b", "endsolid b", ""]  # fmt: skip
    file = read(ending.join(lines).encode("latin-1"), "a.STL")
    assert file.mesh.area == pytest.approx(4.0)


FACETS = "".join(f"facet normal 0 0 1\nouter loop\nvertex 0 0 {k}\nvertex 2 0 {k}\nvertex 0 2 {k}\n"
                 "endloop\nendfacet\n" for k in range(3))  # fmt: skip


@pytest.mark.parametrize(
    "text",
    [
        FACETS.replace("endloop", "end loop").replace("endfacet", "end facet"),
        FACETS.replace("endloop\n", ""),
        FACETS.replace("\n", " "),  # all in one line
        FACETS.replace("\n", " ").replace("facet n", "\nfacet n"),  # a facet a line
        FACETS.replace("1\nouter", "1 outer").upper(),
        FACETS.replace("2", "2.000000E+000").replace("\n", "\r\n"),
        FACETS + "\x1a",  # of CP/M and DOS
        FACETS + 200 * "\0",
    ],
)
@pytest.mark.parametrize("name", ["a", "facet of an outer vertex, in ten words of a name"])
def test_text_in_the_spellings_of_programs(read, text, name):
    for mark in (b"", b"\xef\xbb\xbf"):
        file = read(mark + f"solid {name}\n{text}".encode(), "a.stl")
        assert (len(file.triangles), file.mesh.area) == (3, pytest.approx(6.0))


def box_text():
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    text = box.export(file_type="stl_ascii")
    return text if text.endswith("\n") else text + "\n"


def test_text_that_is_cut_off_is_no_half_mesh(read):
    """Cut at every byte: all its triangles, none (a cut in the name), or one error.

    A cut between two facets leaves a whole file without `endsolid`, which some programs leave out.
    """
    text = box_text()
    ends = [found.end() for found in re.finditer("endfacet", text)]
    between = {k for end in ends for k in range(end, len(text)) if not text[end:k].strip()}
    for length in range(text.index("facet") + 1, len(text)):
        whole = sum(end <= length for end in ends)
        if length in between or whole == len(ends):
            assert len(read(text[:length], "a.stl").triangles) == whole
        else:
            with pytest.raises(DataFileError, match=r"cut off|line \d+: a vertex|has no triangle"):
                read(text[:length], "a.stl")


def test_a_half_box_names_what_is_missing(read):
    text = box_text()
    cut = text.index("endfacet", len(text) // 2) + 1
    for half in (text[:cut], text[: cut - 1], " ".join(text[:cut].split())):
        with pytest.raises(DataFileError, match="cut off within a facet: 'endfacet' is missing"):
            read(half, "a.stl")
    next_facet = text.index("facet normal", cut + 8)
    for cut_off in (text[: next_facet + 3], " ".join(text[: next_facet + 3].split())):
        with pytest.raises(DataFileError, match="cut off: its last word is 'fac'"):
            read(cut_off, "a.stl")
    assert len(read(text.replace("endsolid", "endsolid f"), "a.stl").triangles) == 12
    with pytest.raises(DataFileError, match="has no triangle"):
        read(SQUARE + "f 1 2 3 4\n", "a.stl")


# ------------------------------------------------------------------------- far from the origin


def yard(path, **settings):
    return parse_scenario(
        {
            "name": "yard",
            "world": {"meshes": [{"file": str(path), **settings}]},
            "types": {"a": {}},
            "uavs": [{"type": "a", "position_m": [0.0, 0.0]}],
        }
    )


def test_projected_coordinates_keep_their_precision(tmp_path):
    """A post of 0.2 m in UTM coordinates: single precision would round it to half metres."""
    x, y = 432_111.10, 5_411_222.30
    corners = [(x, y, 400.0), (x + 0.2, y, 400.0), (x + 0.2, y, 403.0), (x, y, 403.0)]
    path = tmp_path / "post.obj"
    path.write_text("".join(f"v {a} {b} {c}\n" for a, b, c in corners) + "f 1 2 3 4\n")
    with pytest.raises(DataFileError, match=r"position_m = \[-432111, -5411222, -402\]"):
        mesh_solids(yard(path))
    (solid,) = mesh_solids(yard(path, position_m=[-432_111.0, -5_411_222.0, -400.0]))
    np.testing.assert_allclose(solid.mesh.bounds, [[0.1, 0.3, 0], [0.3, 0.3, 3]], atol=1e-6)


def test_an_inventory_in_projected_coordinates_has_a_position(tmp_path):
    path = tmp_path / "trees.csv"
    path.write_text("x_m,y_m\n432111.25,5411222.5\n432121.25,5411232.5\n")
    forest = {"kind": "inventory", "file": str(path), "species": "conifer"}
    data = {
        "name": "stand",
        "world": {"forest": forest},
        "types": {"a": {}},
        "uavs": [{"type": "a", "position_m": [0.0, 0.0]}],
    }
    with pytest.raises(ScenarioError, match=r"position_m = \[-432116, -5411228\] moves"):
        geometry_of(parse_scenario(data))
    forest |= {"position_m": [-432100, -5411200], "region_m": [0, 0, 20, 30]}
    built = geometry_of(parse_scenario(data)).forest
    np.testing.assert_allclose(built.position_map[:, :2], [[11.25, 22.5]])
