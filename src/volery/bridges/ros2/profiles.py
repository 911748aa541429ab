"""Quality of service of what the simulation publishes, as the field has it.

A publisher that offers less than a subscription asks for is not heard, so everything is reliable
but what sensors stream, which ROS 2 drivers publish best effort (rclcpp's `SensorDataQoS`).
"""

from __future__ import annotations

from volery.bridges.ros2.middleware import Profile

SENSOR_DATA = Profile(reliable=False, depth=5)
"""rmw_qos_profile_sensor_data."""
SERVICES = Profile()
"""rmw_qos_profile_services_default."""
COMMANDS = Profile(depth=100)
"""Of what comes in: bursts of several UAVs' commands between two looks."""

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
"""Of sensor_msgs. Joint states and batteries are states, not measurements that replace each other
within milliseconds: their publishers are reliable."""
_NAMED = {
    "/tf": Profile(depth=100),  # tf2_ros::DynamicBroadcasterQoS
    "/clock": Profile(depth=1),  # subscribers: rclcpp::ClockQoS, best effort, depth 1
    "/parameter_events": Profile(depth=1000),  # rmw_qos_profile_parameter_events
}


def profile_of(topic: str, msgtype: str, *, latched: bool) -> Profile:
    """How the simulation publishes a topic."""
    if latched:
        return Profile(latched=True, depth=1)  # as maps and tf2_ros::StaticBroadcasterQoS
    named = _NAMED.get(topic)
    if named is not None:
        return named
    package, _, name = msgtype.split("/")
    return SENSOR_DATA if package == "sensor_msgs" and name in _STREAMS else Profile()


def common_profile(offers: list[Profile]) -> Profile:
    """The most that a subscription can ask of all publishers on its topic."""
    if not offers:
        return COMMANDS
    return COMMANDS._replace(
        reliable=all(offer.reliable for offer in offers),
        latched=all(offer.latched for offer in offers),
    )
