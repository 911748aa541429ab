"""Quality of service of the simulation's topics, as usual in ROS 2.

A subscription does not match a publisher that offers less than it requests, so all topics are
reliable but sensor streams, which ROS 2 drivers publish best effort (rclcpp's `SensorDataQoS`).
"""

from __future__ import annotations

from volery.bridges.ros2.middleware import Profile

SENSOR_DATA = Profile(reliable=False, depth=5)
"""Profile rmw_qos_profile_sensor_data."""
SERVICES = Profile()
"""Profile rmw_qos_profile_services_default."""
COMMANDS = Profile(depth=100)
"""Profile of received topics: bursts of several UAVs' commands between two surveys."""

_STREAMS = frozenset(
    {
        "CompressedImage",
        "FluidPressure",
        "Image",
        "CameraInfo",
        "Imu",
        "LaserScan",
        "MagneticField",
        "MultiEchoLaserScan",
        "NavSatFix",
        "PointCloud2",
        "Range",
        "Temperature",
    }
)
"""Types of sensor_msgs. Joint states and batteries are states, not measurements that replace each
other within milliseconds: their publishers are reliable."""
_NAMED = {
    "/tf": Profile(depth=100),  # tf2_ros::DynamicBroadcasterQoS
    "/clock": Profile(depth=1),  # subscribers: rclcpp::ClockQoS, best effort, depth 1
    "/parameter_events": Profile(depth=1000),  # rmw_qos_profile_parameter_events
}


def profile_of(topic: str, msgtype: str, *, latched: bool) -> Profile:
    """Returns the simulation's profile of a topic."""
    if latched:
        return Profile(latched=True, depth=1)  # as maps and tf2_ros::StaticBroadcasterQoS
    named = _NAMED.get(topic)
    if named is not None:
        return named
    package, _, name = msgtype.split("/")
    return SENSOR_DATA if package == "sensor_msgs" and name in _STREAMS else Profile()


def common_profile(offers: list[Profile]) -> Profile:
    """Returns the most that a subscription can request from all publishers on its topic."""
    if not offers:
        return COMMANDS
    return COMMANDS._replace(
        reliable=all(offer.reliable for offer in offers),
        latched=all(offer.latched for offer in offers),
    )
