"""Files of visitors: good ones become scenarios, bad ones a clear message."""

import json

import numpy as np
import pytest
import trimesh
from page_bench import fetch, serving
from PIL import Image

from volery.core.errors import VoleryError
from volery.runtime.construction.worlds import build_forest, build_solids, build_terrain
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.load import load_scenario
from volery.server.uploads import kinds, scenario_builder
from volery.server.uploads.kinds import KINDS
from volery.server.uploads.route import name_for
from volery.server.uploads.validation import check


def outlines(*corners):
    ring = [[24.94, 60.17], [24.9405, 60.17], [24.9405, 60.1703], [24.94, 60.1703], [24.94, 60.17]]
    geometry = {"type": "Polygon", "coordinates": [list(corners) or ring]}
    feature = {"type": "Feature", "properties": {"height": "12"}, "geometry": geometry}
    return json.dumps({"type": "FeatureCollection", "features": [feature]}).encode()


def moving_ai():
    return b"type octile\nheight 3\nwidth 4\nmap\n....\n.@@.\n....\n"


def box():
    return trimesh.creation.box((4.0, 6.0, 8.0)).export(file_type="stl")


INVENTORY = b"x_m,y_m,dbh_cm\n0,0,20\n8,3,30\n-6,9,25\n"


@pytest.fixture
def checked(tmp_path):
    """Makes and builds a scenario of a file's content."""

    def run(kind, suffix, content, name="yard"):
        path = tmp_path / f"{kind}{suffix}"
        path.write_bytes(content)
        check(kind, path, name, f"my yard{suffix}")
        return load_scenario(tmp_path / ScenarioCatalog.FILE)

    return run


def test_a_matrix_becomes_blocks(checked):
    scenario = checked("grid_map", ".csv", b"0,0,0\n0,1,0\n0,0,0\n0,0,1\n")
    (solid,) = build_solids(scenario, build_terrain(scenario))
    low, high = solid.mesh.bounds
    # 2 m cells around the origin: x -3..3, y -4..4; the lowest row of the file has the lowest y
    np.testing.assert_allclose(high, (3.0, 2.0, 5.0))
    np.testing.assert_allclose(low[:2], (-1.0, -4.0))
    assert scenario.name == "yard"
    assert scenario.uav_count == 2
    assert "my yard.csv" in scenario.description


def test_maps_of_movingai_and_images(checked, tmp_path):
    scenario = checked("grid_map", ".map", moving_ai())
    assert build_solids(scenario, build_terrain(scenario))
    Image.fromarray(np.array([[255, 0], [255, 255]], np.uint8)).save(tmp_path / "picture.png")
    scenario = checked("grid_map", ".png", (tmp_path / "picture.png").read_bytes())
    (solid,) = build_solids(scenario, build_terrain(scenario))
    np.testing.assert_allclose(solid.mesh.bounds[:, :2], [[0.0, 0.0], [2.0, 2.0]])


ROOM = b"""image: ../saved/elsewhere/room.pgm
resolution: 0.5
origin: [-1.0, -1.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""


def room_pgm():
    """3 x 2 cells, of which the first of the lower row is blocked."""
    return b"P5\n3 2\n255\n" + bytes([254, 254, 254, 0, 254, 254])


def test_a_map_of_map_server_keeps_its_origin_and_cells(checked, tmp_path):
    (tmp_path / "grid_map.pgm").write_bytes(room_pgm())
    scenario = checked("grid_map", ".yaml", ROOM)
    (solid,) = build_solids(scenario, build_terrain(scenario))
    np.testing.assert_allclose(solid.mesh.bounds[:, :2], [[-1.0, -1.0], [-0.5, -0.5]])
    assert scenario.uavs[0].position_m[0] < -1.0


def test_outlines_become_a_city_around_its_middle(checked):
    scenario = checked("city", ".geojson", outlines())
    assert scenario.world.origin.latitude_deg == pytest.approx(60.17015)
    assert scenario.world.origin.longitude_deg == pytest.approx(24.94025)
    assert scenario.world.city is not None


def test_only_buildings_of_an_export_decide_about_the_middle(checked):
    export = json.loads(outlines())
    (house,) = export["features"]
    house["properties"]["building"] = "yes"
    ring = [[24.0, 60.0], [25.5, 60.0], [25.5, 60.5], [24.0, 60.0]]
    border = {**house, "properties": {"boundary": "administrative"}}
    border["geometry"] = {"type": "Polygon", "coordinates": [ring]}
    features = "\n".join(json.dumps(feature) for feature in (border, house))
    scenario = checked("city", ".geojson", features.encode())
    assert scenario.world.origin.latitude_deg == pytest.approx(60.17015)
    assert scenario.world.origin.longitude_deg == pytest.approx(24.94025)
    assert scenario.world.terrain.extent_m < 200.0


def test_a_mesh_stands_on_the_ground_around_the_origin(checked):
    scenario = checked("mesh", ".stl", box())
    (solid,) = build_solids(scenario, build_terrain(scenario))
    np.testing.assert_allclose(solid.mesh.bounds, [[-2, -3, 0], [2, 3, 8]], atol=1e-5)


def test_an_inventory_becomes_a_forest(checked):
    scenario = checked("forest", ".csv", INVENTORY)
    forest = build_forest(scenario, build_terrain(scenario))
    np.testing.assert_allclose(forest.position_map[:, :2], [[0, 0], [8, 3], [-6, 9]])
    np.testing.assert_allclose(forest.dbh_m, [0.2, 0.3, 0.25])


def test_projected_coordinates_are_moved_to_the_origin(checked):
    trees = b"x_m,y_m\n385000.25,6672000.5\n385010.25,6672010.5\n"
    scenario = checked("forest", ".csv", trees)
    forest = build_forest(scenario, build_terrain(scenario))
    np.testing.assert_allclose(forest.position_map[:, :2], [[-4.75, -5.5], [5.25, 4.5]])
    wall = b"v 385000.1 6672000.3 0\nv 385000.3 6672000.3 0\nv 385000.3 6672000.3 4\nf 1 2 3\n"
    scenario = checked("mesh", ".obj", wall)
    (solid,) = build_solids(scenario, build_terrain(scenario))
    np.testing.assert_allclose(solid.mesh.bounds, [[-0.1, 0, 0], [0.1, 0, 4]], atol=1e-5)


@pytest.mark.parametrize(
    ("kind", "suffix", "content", "why"),
    [
        ("grid_map", ".csv", b"0,1\n0,2\n", "line 2, column 2: '2'"),
        ("grid_map", ".csv", b"0,1\n0\n", "line 2 has 1 entry"),
        ("grid_map", ".png", b"\x89PNG\r\n\x1a\n broken", "grid_map.png"),
        ("grid_map", ".map", b"type octile\n", "grid_map.map"),
        ("city", ".geojson", b"{", "not valid JSON"),
        ("city", ".geojson", b'{"type": "FeatureCollection", "features": []}', "no outline of a b"),
        ("city", ".json", outlines([0, 0], [0, 0], [0, 0], [0, 0]), "no building is left"),
        ("city", ".json", outlines([500, 0], [1, 1], [2, 2], [500, 0]), "within 180 and 90"),
        ("mesh", ".obj", b"v 0 0 0\n", "no triangle"),
        ("mesh", ".glb", b"glTF" + b"\0" * 40, "mesh.glb"),
        ("forest", ".csv", b"x,y\n1,2\n", "row 1, column 1: unknown name"),
        ("forest", ".csv", b"x_m,y_m\n", "0 trees"),
        ("forest", ".csv", b"x_m,y_m\n385000,6672000\n0,0\n", "at most 5000 m"),
        ("forest", ".csv", b"x_m,y_m\n1,nan\n", "row 2"),
    ],
)
def test_what_is_wrong_is_reported_in_a_sentence(checked, kind, suffix, content, why):
    with pytest.raises(VoleryError, match=why):
        checked(kind, suffix, content)


def test_there_are_limits(checked, monkeypatch):
    monkeypatch.setattr(scenario_builder, "MAX_CELLS", 3)
    with pytest.raises(VoleryError, match="4 x 1 cells; at most 3"):
        checked("grid_map", ".csv", b"0,0,0,1\n")
    monkeypatch.setattr(scenario_builder, "MAX_TREES", 2)
    with pytest.raises(VoleryError, match="3 trees; allowed are 1 to 2"):
        checked("forest", ".csv", INVENTORY)
    monkeypatch.setattr(scenario_builder, "MAX_TRIANGLES", 11)
    with pytest.raises(VoleryError, match="12 triangles; at most 11"):
        checked("mesh", ".stl", box())


def test_descriptions_hold_no_toml(checked, tmp_path):
    path = tmp_path / "forest.csv"
    path.write_bytes(INVENTORY)
    evil = '"\nname = "other"\n\x00\U0001f600.csv'
    check("forest", path, "yard", evil)
    assert load_scenario(tmp_path / ScenarioCatalog.FILE).name == "yard"


@pytest.mark.parametrize(
    ("called", "name"),
    [
        ("My Yard (2).png", "my_yard_2"),
        ("../../etc/passwd.csv", "passwd"),
        ("C:\\maps\\Hall.png", "hall"),
        ("42.csv", "upload"),
        ("hover.csv", "hover_2"),
        ("x" * 200 + ".csv", "x" * 30),
        ("Ω.csv", "upload"),
    ],
)
def test_names_are_ours(called, name, tmp_path):
    assert name_for(called, ScenarioCatalog(tmp_path)) == name


OWN = """# my flight
name = "mine"
description = '''
name = "not this one"
[neither]
'''
[types.f450]
airframe = "f450"
[[types.f450.sensors]]
kind = "imu"
[[uavs]]
type = "f450"
position_m = [0.0, 0.0]
"""


def test_a_scenario_keeps_all_but_its_name(checked):
    scenario = checked("scenario", ".toml", OWN.encode())
    assert scenario.name == "yard"
    assert scenario.description.startswith('name = "not this one"')
    assert scenario.uav_count == 1


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("name = ", "not valid TOML"),
        ("x = " + "[" * 5000, "TOML|nested too deep"),
        (OWN.replace("name", "title", 1), "name on a line of its own"),
        (OWN.replace("f450", "f999", 2), "f999"),
        (OWN + "last_position_m = [9.0, 0.0]\ncount = 1001\n", "at most 1000"),
        (OWN + '[[nodes]]\nnode = "os:system"\n', "does not ship with Volery"),
        (OWN + '[[nodes]]\nnode = "volery.server.page:STATIC"\n', "does not ship"),
        (
            OWN
            + '[world.forest]\nkind = "inventory"\nspecies = "broadleaf"\nfile = "/etc/passwd"\n',
            "that may be read",
        ),
        (
            OWN
            + '[[world.meshes]]\nname = "a"\nfile = "../../other/a.stl"\nposition_m = [0, 0, 0]\n',
            "that may be read",
        ),
    ],
)
def test_a_foreign_scenario_reaches_nothing_of_the_server(checked, text, why):
    with pytest.raises(VoleryError, match=why):
        checked("scenario", ".toml", text.encode())


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    with serving(uploads=tmp_path_factory.mktemp("run") / "uploads") as server:
        yield server


def test_a_good_file_over_http_can_be_loaded(server):
    path = "/api/uploads?kind=grid_map&name=My%20Hall.csv"
    response = fetch(server, path, "POST", b"0,0\n0,1\n")
    assert (response.status, response.json) == (201, {"scenario": "my_hall"}), response.body
    card = fetch(server, "/api/scenarios").json[-1]
    assert (card["name"], card["world"], card["uploaded"]) == ("my_hall", "grid_map", True)


def test_a_map_of_map_server_over_http_comes_with_its_image(server):
    query = f"kind=grid_map&name=room.yaml&image=room.pgm&head={len(ROOM)}"
    response = fetch(server, f"/api/uploads?{query}", "POST", ROOM + room_pgm())
    assert (response.status, response.json) == (201, {"scenario": "room"}), response.body
    before = fetch(server, "/api/scenarios").json
    broken = b"image: room.pgm\nresolution: 0.5\n"
    query = f"kind=grid_map&name=b.yaml&image=b.pgm&head={len(broken)}"
    response = fetch(server, f"/api/uploads?{query}", "POST", broken + room_pgm())
    assert response.status == 422
    assert "b.yaml: origin must be [x, y, yaw]" in response.error
    assert "/" not in response.error
    assert fetch(server, "/api/scenarios").json == before


def test_a_scenario_over_http_can_be_loaded(server):
    response = fetch(
        server, "/api/uploads?kind=scenario&name=My%20Flight.toml", "POST", OWN.encode()
    )
    assert (response.status, response.json) == (201, {"scenario": "my_flight"}), response.body
    cards = {card["name"]: card for card in fetch(server, "/api/scenarios").json}
    assert cards["my_flight"]["airframes"] == ["f450"]
    response = fetch(server, "/api/uploads?kind=scenario&name=b.toml", "POST", b"name = [")
    assert response.status == 422
    assert "b.toml: not valid TOML" in response.error
    assert "/" not in response.error


def test_a_bad_file_over_http_leaves_nothing_behind(server):
    before = fetch(server, "/api/scenarios").json
    response = fetch(server, "/api/uploads?kind=grid_map&name=hall.csv", "POST", b"0,x\n")
    assert response.status == 422
    assert "hall.csv, line 1, column 2: 'x'; allowed are 0 and 1" in response.error
    assert "/" not in response.error  # no path of the server
    assert fetch(server, "/api/scenarios").json == before


@pytest.mark.parametrize(
    ("query", "body", "status", "why"),
    [
        ("kind=virus&name=a.csv", b"x", 400, "one of grid_map, city, mesh, forest, scenario"),
        ("kind=mesh&name=a.exe", b"x", 415, "'.exe'"),
        ("kind=mesh", b"x", 415, "is read from"),
        ("kind=forest&name=a.csv", b"", 400, "empty"),
        ("kind=grid_map&name=a.yaml", ROOM, 415, "together with its image"),
        ("kind=grid_map&name=a.yml&image=a.toml&head=3", ROOM, 415, "together with its image"),
        ("kind=grid_map&name=a.pgm", room_pgm(), 415, "together with its .yaml"),
        ("kind=grid_map&name=a.yaml&image=a.pgm", ROOM, 400, "head is the size"),
        ("kind=grid_map&name=a.yaml&image=a.pgm&head=9999", ROOM, 400, "head is the size"),
    ],
)
def test_refusals_over_http(server, query, body, status, why):
    response = fetch(server, f"/api/uploads?{query}", "POST", body)
    assert response.status == status
    assert why in response.error


def test_too_large_a_file_is_not_read_to_its_end(server, monkeypatch):
    small = kinds.Kind((".csv",), 1000, "trees")
    monkeypatch.setitem(KINDS, "forest", small)
    response = fetch(server, "/api/uploads?kind=forest&name=a.csv", "POST", b"x" * 1001)
    assert response.status == 413
    assert "0.001 MB" in response.error

    def endless():
        for _ in range(100):
            yield b"x" * 100

    response = fetch(server, "/api/uploads?kind=forest&name=a.csv", "POST", endless())
    assert response.status == 413


def test_a_server_without_a_folder_takes_nothing():
    with serving() as server:
        response = fetch(server, "/api/uploads?kind=forest&name=a.csv", "POST", INVENTORY)
        assert response.status == 409
