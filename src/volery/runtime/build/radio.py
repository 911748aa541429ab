"""Builds the radio network of a scenario."""

from __future__ import annotations

from collections.abc import Mapping

from volery.comms.radio.channel import RadioChannel
from volery.comms.radio.network import RadioNetwork
from volery.core.arrays import Array
from volery.engine.engine import Engine
from volery.graph.graph import Graph
from volery.runtime.build.line_of_sight import LineOfSight
from volery.scenario.schema import Scenario
from volery.world.forest import Forest


def build_radio(
    scenario: Scenario, graph: Graph, engine: Engine, forest: Forest | None
) -> RadioNetwork | None:
    """Returns the network that the scenario's UAVs join; None without a radio."""
    radio = scenario.radio
    if radio is None:
        return None

    def places() -> Mapping[int, Array]:
        position = engine.fleet.state.position_map
        rows = {name: row for row, name in enumerate(engine.names)}
        return {address: position[rows[name]] for name, address in net.addresses().items()}

    link = None
    if radio.links == "modelled":
        link = RadioChannel(radio, scenario.seed, places, LineOfSight(engine.scene, forest))
    net = RadioNetwork(graph, engine, radio.topics, link)
    return net
