"""What a scenario needs to start, checked before anything is built."""

from __future__ import annotations

from volery.runtime.build.fleet import check_types
from volery.runtime.build.message_loading import learn_messages
from volery.runtime.build.node_loading import check_nodes
from volery.scenario.node_packages import check_packages
from volery.scenario.schema import Scenario


def check_start(scenario: Scenario) -> None:
    """Raises `VoleryError` if a type, a package or the class of a node of a scenario is missing.

    It imports the nodes' modules, and learns the messages that these may import.
    """
    check_types(scenario)
    check_packages(scenario)
    learn_messages(scenario)
    check_nodes(scenario)
