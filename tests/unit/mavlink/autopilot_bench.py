"""What the tests of bridges for real autopilots begin with."""

import socket

from volery.scenario.load import parse_scenario


def free_port(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def irises(count=1):
    """Scenario of `count` irises side by side on flat ground."""
    uavs = {"type": "iris", "count": count}
    data = {
        "name": "flat",
        "duration_s": 1000.0,
        "types": {"iris": {"airframe": "iris"}},
        "uavs": [{**uavs, "position_m": [0.0, 0.0], "last_position_m": [5.0, 0.0]}],
    }
    return parse_scenario(data, where="flat")
