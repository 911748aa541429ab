"""glTF, OBJ and STL files as solids; broken ones are one clear error each."""

import json
import struct

import numpy as np
import pytest
import trimesh

from volery.core.errors import DataFileError, ScenarioError
from volery.runtime.construction.user_meshes import mesh_solids
from volery.scenario.load import parse_scenario
from volery.world import mesh_files
from volery.world.materials import Material
from volery.world.mesh_files import read_mesh
from volery.world.scene import Scene


@pytest.fixture
def box_file(tmp_path):
    """Write a box of 1 x 2 x 3 in the file's axes, red, its low corner at the origin."""

    def write(name):
        box = trimesh.creation.box((1.0, 2.0, 3.0))
        box.apply_translation((0.5, 1.0, 1.5))
        paint = trimesh.visual.material.PBRMaterial(baseColorFactor=[0.8, 0.1, 0.1, 1.0])
        box.visual = trimesh.visual.TextureVisuals(material=paint)
        path = tmp_path / name
        if path.suffix != ".gltf":
            path.write_bytes(_bytes(box.export(file_type=path.suffix[1:])))
            return path
        for part, content in box.scene().export(file_type="gltf").items():
            (tmp_path / part).write_bytes(content)
        return (tmp_path / "model.gltf").rename(path)

    return write


def _bytes(content):
    return content.encode() if isinstance(content, str) else content


@pytest.mark.parametrize(
    ("name", "up", "low", "high"),
    [
        ("box.stl", None, (0, 0, 0), (1, 2, 3)),
        ("box.obj", None, (0, 0, 0), (1, 2, 3)),
        ("box.glb", None, (0, -3, 0), (1, 0, 2)),  # y up: (x, y, z) is our (x, -z, y)
        ("box.gltf", None, (0, -3, 0), (1, 0, 2)),
        ("box.glb", "z", (0, 0, 0), (1, 2, 3)),
        ("box.stl", "y", (0, -3, 0), (1, 0, 2)),
    ],
)
def test_every_format_and_its_axes(box_file, name, up, low, high):
    file = read_mesh(box_file(name), up=up)
    assert len(file.mesh) == 12
    np.testing.assert_allclose(file.mesh.bounds, [low, high], atol=1e-6)
    a, b, c = np.moveaxis(file.mesh.corners.astype(float), 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0 == pytest.approx(6.0)  # faces outwards


def test_the_base_colour_of_gltf_is_kept(box_file):
    assert read_mesh(box_file("box.glb")).colour == pytest.approx((0.8, 0.1, 0.1), abs=0.01)
    assert read_mesh(box_file("box.stl")).colour == (0.5, 0.5, 0.5)


def scenario_with(path, **settings):
    return parse_scenario(
        {
            "name": "yard",
            "world": {"meshes": [{"file": str(path), **settings}]},
            "types": {"a": {}},
            "uavs": [{"type": "a", "position_m": [0.0, 0.0]}],
        }
    )


def test_position_rotation_and_scale(box_file):
    """Scaled by 2, a quarter turn to the left, at (10, 20, 1); rays meet it there."""
    scenario = scenario_with(
        box_file("box.stl"),
        name="crate",
        position_m=[10.0, 20.0, 1.0],
        rpy_deg=[0, 0, 90],
        scale=2.0,
        material="wood",
    )
    (solid,) = mesh_solids(scenario)
    np.testing.assert_allclose(solid.mesh.bounds, [[6, 20, 1], [10, 22, 7]], atol=1e-5)
    assert (solid.name, solid.material) == ("crate", Material.WOOD)
    scene = Scene(None, None, solids=[solid])
    hits = scene.cast([[0.0, 21.0, 3.0]], [[1.0, 0.0, 0.0]], 50.0)
    assert hits.distance[0] == pytest.approx(6.0, abs=1e-5)
    assert scene.instance_name(int(hits.instance[0])) == "crate"
    assert scene.enclosing([[8.0, 21.0, 3.0]]).tolist() == [1]
    scene.close()


def test_stretching_and_defaults(box_file):
    (solid,) = mesh_solids(scenario_with(box_file("box.glb"), scale=[1.0, 2.0, 3.0]))
    np.testing.assert_allclose(solid.mesh.bounds, [[0, -6, 0], [1, 0, 6]], atol=1e-5)
    assert (solid.name, solid.material) == ("box", Material.PAINTED)
    assert solid.look.colour == pytest.approx((0.8, 0.1, 0.1), abs=0.01)


def ascii_stl(corner):
    return (
        "solid a\nfacet normal 0 0 1\nouter loop\n"
        f"vertex {corner} 0 0\nvertex 0 1 0\nvertex 0 0 0\nendloop\nendfacet\nendsolid a\n"
    ).encode()


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.ply", b"ply", "meshes are read from"),
        ("a.stl", b"", "cannot be read|no triangle"),
        ("a.stl", ascii_stl("nan"), "vertices that are not finite numbers"),
        ("a.stl", ascii_stl("1e300"), "vertices that are not finite numbers below 1e"),
        ("a.stl", ascii_stl("0"), "has an area"),
        (
            "a.stl",
            bytes(80) + struct.pack("<I", 4_000_000_000) + bytes(50),
            "cannot be read|no triangle",
        ),
        ("a.obj", b"v 0 0 0\nv 1 0 0\n", "no triangle|cannot be read"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "cannot be read|has vertex"),
        ("a.obj", b"\xff\xfe\x00\x01" * 50, "cannot be read|no triangle"),
        ("a.glb", b"glTF" + bytes(4), "cannot be read"),
        ("a.gltf", b'{"asset": {"version": "2.0"}}', "no triangle|cannot be read"),
        ("a.gltf", b"{", "cannot be read"),
    ],
)
def test_broken_files_are_one_clear_error(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(DataFileError, match=message) as caught:
        read_mesh(path)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_truncated_glb_at_every_length(box_file):
    path = box_file("box.glb")
    whole = path.read_bytes()
    for length in range(0, len(whole), 37):
        path.write_bytes(whole[:length])
        with pytest.raises(DataFileError):
            read_mesh(path)


def test_a_small_file_that_draws_millions_of_triangles(tmp_path, box_file, monkeypatch):
    """Nodes may share a mesh: they are counted before they are copied."""
    monkeypatch.setattr(mesh_files, "MAX_TRIANGLES", 1000)
    content = json.loads(box_file("box.gltf").read_text())
    mesh = next(node["mesh"] for node in content["nodes"] if "mesh" in node)
    content["nodes"] = [{"mesh": mesh, "name": f"n{k}"} for k in range(100)]
    content["scenes"] = [{"nodes": list(range(100))}]
    (tmp_path / "many.gltf").write_text(json.dumps(content))
    with pytest.raises(DataFileError, match="more than 1,000 triangles"):
        read_mesh(tmp_path / "many.gltf")


def test_errors_name_scenario_and_key(tmp_path, box_file):
    with pytest.raises(DataFileError, match=r"yard: world\.meshes\[0\]: no file 'none.obj'"):
        mesh_solids(scenario_with("none.obj"))
    with pytest.raises(DataFileError, match=r"world\.meshes\[0\]: .*is `scale` right"):
        mesh_solids(scenario_with(box_file("box.stl"), scale=1e6))
    with pytest.raises(ScenarioError, match=r"world\.meshes\[0\]\.scale"):
        scenario_with("a.stl", scale=-1.0)
    with pytest.raises(ScenarioError, match=r"world\.meshes\[0\]\.material"):
        scenario_with("a.stl", material="cheese")


@pytest.mark.parametrize(
    ("scale", "question"),
    [
        (1.0, None),
        (0.01, None),
        (500.0, "model.obj is 500 x 1e+03 x 1.5e+03 m: if the file is in mm, set scale = 0.001"),
        (0.001, "model.obj is 0.001 x 0.002 x 0.003 m: is `scale` right?"),
    ],
)
def test_a_size_that_suggests_another_unit_is_questioned(box_file, caplog, scale, question):
    mesh_solids(scenario_with(box_file("model.obj"), scale=scale))
    assert caplog.messages == ([] if question is None else [question])


def test_a_path_of_windows_is_questioned():
    with pytest.raises(DataFileError, match=r"no file 'sub\\gate.stl' .*; write / between folders"):
        mesh_solids(scenario_with("sub\\gate.stl"))
