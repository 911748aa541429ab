"""`volery list`: prints the shipped scenarios and the nodes that installed packages register."""

from __future__ import annotations

from volery.cli.tables import print_table


def show_scenarios() -> None:
    """Prints names, fleet sizes, durations and descriptions."""
    from volery.scenario import library
    from volery.scenario.load import load_scenario

    rows = []
    for name in library.names():
        scenario = load_scenario(name)
        count = str(scenario.uav_count)
        rows.append((name, count, f"{scenario.duration_s:g} s", library.describe(name)))
    print_table(("scenario", "UAVs", "duration", "what it is"), rows, right=(1, 2))


def show_nodes() -> None:
    """Prints the registered names of nodes and their classes."""
    from volery.scenario.node_names import registered_nodes

    print_table(("node", "class"), list(registered_nodes().items()))
