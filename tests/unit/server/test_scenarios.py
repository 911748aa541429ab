"""Cards of scenarios, and their images."""

import sys
from io import BytesIO
from pathlib import Path
from runpy import run_path

import pytest
from page_bench import fetch, serving
from PIL import Image, ImageStat

from volery.scenario import library
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.load import load_scenario, parse_scenario
from volery.server.cards import CARDS
from volery.server.gallery import gallery, title_of
from volery.server.scenarios import cards_of

RENDERER = run_path(str(Path(__file__).parents[3] / "tools" / "scenario_cards.py"))


@pytest.mark.parametrize("name", library.names())
def test_every_scenario_that_ships_has_an_image(name):
    path = CARDS / f"{name}.jpg"
    with Image.open(path) as image:
        assert image.format == "JPEG"
        assert image.size == (RENDERER["WIDTH"], RENDERER["HEIGHT"])
        low, high = image.convert("L").getextrema()
        assert high - low > 40, "the image shows nothing"
        assert ImageStat.Stat(image.convert("L")).mean[0] > 60, "the image is black"
    assert path.stat().st_size < 80_000


def test_the_gallery_has_each_scenario_that_ships_in_words():
    assert sorted(gallery()) == library.names()
    titles = [entry.title for entry in gallery().values()]
    assert len(set(titles)) == len(titles)
    assert not any("_" in title for title in titles)
    assert (title_of("hover"), title_of("my_hall")) == ("First hover", "my_hall")


def test_views_are_of_scenarios_that_ship():
    assert set(RENDERER["VIEWS"]) <= set(library.names())


def test_cards_show_what_the_scenarios_say():
    cards = {card["name"]: card for card in cards_of(ScenarioCatalog())}
    assert list(cards) == list(gallery())
    assert (cards["hover"]["title"], cards["hover"]["section"]) == ("First hover", "Start here")
    city, survey, hover = cards["city_flight"], cards["forest_survey"], cards["hover"]
    assert (city["world"], city["uavs"], city["duration_s"]) == ("city", 3, 120.0)
    assert city["airframes"] == ["f450"]
    assert survey["world"] == "forest"
    assert "lidar" in survey["sensors"]
    assert (hover["world"], cards["grid_map"]["world"]) == ("open", "grid_map")
    assert not any(card["uploaded"] for card in cards.values())


def test_cards_say_which_packages_are_missing(monkeypatch):
    """Also where a package is installed or removed while the server runs."""
    cards_of(ScenarioCatalog())
    monkeypatch.setitem(sys.modules, "cv2", None)
    lacking = {card["name"]: card["missing"] for card in cards_of(ScenarioCatalog())}
    command = 'tag_detection needs opencv-python-headless: pip install "volery[vision]"'
    assert lacking.pop("servoing") == command
    assert lacking["hover"] == ""


def test_cards_and_images_over_http():
    with serving() as server:
        cards = fetch(server, "/api/scenarios").json
        for card in cards[:3]:
            image = fetch(server, card["picture"].removeprefix("."))
            assert image.headers["Content-Type"] == "image/jpeg"
            Image.open(BytesIO(image.body)).verify()


def test_uploaded_scenarios_stand_behind_and_broken_ones_not_at_all(tmp_path):
    hover = library.path_of("hover").read_text()
    for name, text in (("mine", hover.replace('"hover"', '"mine"')), ("broken", "name = 3")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "scenario.toml").write_text(text)
    (tmp_path / "hover").mkdir()
    (tmp_path / "hover" / "scenario.toml").write_text("name = 4")  # cannot hide the one that ships
    (tmp_path / ".upload_x").mkdir()
    (tmp_path / ".upload_x" / "scenario.toml").write_text(hover)  # is being checked
    catalog = ScenarioCatalog(tmp_path)
    assert catalog.added() == ("broken", "mine")
    last = cards_of(catalog)[-1]
    assert (last["name"], last["uploaded"], last["picture"]) == ("mine", True, None)
    assert catalog.load("hover").uav_count == 1


def test_a_scenario_of_the_command_line_can_be_chosen_again(tmp_path, flat_data):
    mine = parse_scenario({**flat_data, "name": "mine"})
    catalog = ScenarioCatalog(tmp_path, given=mine)
    assert catalog.load("mine") is mine
    assert "mine" in catalog.names()
    assert [card["name"] for card in cards_of(catalog)] == [*gallery(), "mine"]
    assert (cards_of(catalog)[-1]["title"], cards_of(catalog)[-1]["section"]) == ("mine", "Yours")
    # It hides none of the others.
    hidden = ScenarioCatalog(tmp_path, given=parse_scenario({**flat_data, "name": "hover"}))
    assert hidden.load("hover") == load_scenario("hover")
    assert len(cards_of(hidden)) == len(library.names())
