"""Names of nodes: registered ones and `module:Class`."""

import inspect
import pkgutil
from importlib import import_module

import pytest

from volery.core.errors import ScenarioError
from volery.graph.nodes.node import Node
from volery.runtime.construction.node_loading import find_node
from volery.scenario.access import ScenarioAccess
from volery.scenario.load import parse_scenario
from volery.scenario.node_names import (
    is_same_node,
    node_module,
    node_path,
    registered_nodes,
)
from volery.scenario.schema import NodeEntry


def test_a_registered_name_stands_for_its_class_and_a_path_for_itself():
    assert node_path("gap_following").endswith(".gap_following:GapFollowing")
    assert node_path("mine.planning:Planner") == "mine.planning:Planner"
    assert f"{node_module('gap_following')}:GapFollowing" == node_path("gap_following")
    assert is_same_node("gap_following", node_path("gap_following"))
    assert not is_same_node("gap_following", "mapping")


def test_an_unknown_name_is_an_error_with_a_hint():
    with pytest.raises(
        ScenarioError, match=r"no node 'gap_folowing'; did you mean 'gap_following'"
    ):
        node_path("gap_folowing")
    assert node_module("gap_folowing") is None
    assert not is_same_node("gap_folowing", "gap_folowing")


@pytest.mark.parametrize("name", sorted(registered_nodes()))
def test_each_name_that_ships_is_that_of_a_node(name):
    module, _, attribute = node_path(name).partition(":")
    assert issubclass(getattr(import_module(module), attribute), Node)


def test_every_node_that_ships_has_a_name():
    found = set()
    for package in ("autonomy", "comms", "mavlink"):
        folder = import_module(f"volery.{package}")
        for module in pkgutil.walk_packages(folder.__path__, f"{folder.__name__}."):
            kinds = [k for k in vars(import_module(module.name)).values() if inspect.isclass(k)]
            found |= {kind for kind in kinds if issubclass(kind, Node) and kind is not Node}
    leaves = [kind for kind in found if not any(kind in other.__mro__[1:] for other in found)]
    paths = {f"{kind.__module__}:{kind.__name__}" for kind in leaves}
    assert paths == {path for path in registered_nodes().values() if path.startswith("volery.")}


@pytest.mark.parametrize("bad", ["", "a b", ":Class", "module:", "../evil:Node", "-x"])
def test_other_texts_are_refused(flat_data, bad):
    with pytest.raises(ScenarioError, match="node"):
        parse_scenario({**flat_data, "nodes": [{"node": bad}]})


def test_a_scenario_with_an_unknown_name_can_be_read_but_not_flown(flat_data, simulate):
    data = {**flat_data, "nodes": [{"node": "not_installed_here"}]}
    assert parse_scenario(data).nodes[0].node == "not_installed_here"
    with pytest.raises(ScenarioError, match="no node 'not_installed_here'"):
        simulate(data)


@pytest.fixture
def planner_of_another_package(tmp_path, monkeypatch):
    """An installed package that registers node `stranger`."""
    info = tmp_path / "stranger-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[volery.nodes]\nstranger = stranger_node:Stranger\n")
    (tmp_path / "stranger_node.py").write_text(
        "from volery.graph.nodes.node import Node\n"
        "class Stranger(Node):\n"
        "    def __init__(self, **options):\n"
        '        super().__init__("stranger", **options)\n'
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    from volery.core.entry_points import EntryPoints

    monkeypatch.setattr("volery.scenario.node_names._REGISTERED", EntryPoints("volery.nodes"))
    return "stranger"


def test_nodes_of_other_packages_fly_by_name(planner_of_another_package, flat_data, simulate):
    simulation = simulate({**flat_data, "nodes": [{"node": planner_of_another_package}]})
    simulation.run(0.01)
    assert [type(node).__name__ for node in simulation.vehicles.nodes] == ["Stranger"]


def test_a_confined_scenario_starts_no_node_of_another_package(planner_of_another_package):
    entry = NodeEntry(node=planner_of_another_package)
    access = ScenarioAccess(None, is_confined=True, is_trusted=False)
    with pytest.raises(ScenarioError, match="does not ship with Volery"):
        find_node(entry, "an upload", access)
