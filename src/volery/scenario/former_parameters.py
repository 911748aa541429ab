"""Former parameters of Volery's nodes, which recorded logs contain, with their present names."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from volery.core.data_tables import read_table
from volery.scenario.node_names import name_of_former_path


@cache
def all_former_parameters() -> dict[str, dict[str, str]]:
    """Returns the present names by former ones, by the node's registered name."""
    return read_table(__file__, "former_parameters.toml")


def former_parameters(node: str) -> Mapping[str, str]:
    """Returns the renamed parameters of a node, given its name or its former path."""
    return all_former_parameters().get(name_of_former_path(node), {})
