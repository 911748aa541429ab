"""Every bridge, by name."""

from __future__ import annotations

import pytest
from bridge_ros1 import Ros1Bench
from bridge_ros2 import Ros2Bench
from bridge_ros_tcp import ConnectorBench, EndpointBench
from bridge_rosbridge import ClientBench, ServerBench
from bridge_sensor_link import SensorLinkBench
from plain_peers import end_idle_peers

BENCHES = {
    "ros_tcp": (EndpointBench, "ros1"),
    "ros_tcp_2": (EndpointBench, "ros2"),
    "ros_tcp_connector": (ConnectorBench,),
    "rosbridge_json": (ServerBench, "none"),
    "rosbridge_cbor": (ServerBench, "cbor"),
    "rosbridge_raw": (ServerBench, "cbor-raw"),
    "rosbridge_client": (ClientBench,),
    "ros1": (Ros1Bench,),
    "ros2": (Ros2Bench,),
    "sensor_link": (SensorLinkBench,),
}


ROSPY = [  # it uses what is deprecated and forgets to close sockets
    pytest.mark.filterwarnings("ignore:notifyAll:DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


@pytest.fixture(scope="module", autouse=True)
def _no_peers_afterwards():
    yield
    end_idle_peers()


@pytest.fixture(
    params=[pytest.param(name, marks=ROSPY if name == "ros1" else []) for name in BENCHES]
)
def bench(request):
    kind, *options = BENCHES[request.param]
    for marker in request.node.iter_markers("needs"):
        kind.needs(*marker.args)
    made = kind(*options)
    yield made
    made.close()


@pytest.fixture
def client(bench):
    return bench.connect()
