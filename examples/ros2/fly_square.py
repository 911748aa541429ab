"""Flies a square with rclpy, against `volery run hover --seconds 600 --ros2`.

    source /opt/ros/jazzy/setup.bash
    python3 fly_square.py --ros-args -p use_sim_time:=true -p side_m:=4.0

It takes off by a service, flies four sides by velocities, holding its heading, and lands. It needs
nothing of Volery: `std_srvs`, `geometry_msgs` and `nav_msgs` come with ROS 2.
"""

import math

import rclpy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_srvs.srv import Trigger

GAIN = 1.0
TOLERANCE_M = 0.2
TAKE_OFF_M = 1.0


class FlySquare(Node):
    """One corner after the other."""

    def __init__(self):
        super().__init__("fly_square", namespace="/uav1")
        self.side_m = self.declare_parameter("side_m", 4.0).value
        self.speed = self.declare_parameter("speed_m_s", 1.0).value
        self.command = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(Odometry, "odom", self.on_odometry, 10)
        self.take_off = self.create_client(Trigger, "take_off")
        self.land = self.create_client(Trigger, "land")
        self.corners = None
        self.done = False
        self.take_off.wait_for_service()
        self.take_off.call_async(Trigger.Request())

    def on_odometry(self, message):
        """Fly towards the present corner; the commands are in the level frame of the heading."""
        place, turned = message.pose.pose.position, message.pose.pose.orientation
        if self.done or (self.corners is None and place.z < TAKE_OFF_M):
            return
        if self.corners is None:
            x, y, side = place.x, place.y, self.side_m
            self.corners = [(x + side, y), (x + side, y + side), (x, y + side), (x, y)]
        east, north = self.corners[0][0] - place.x, self.corners[0][1] - place.y
        if math.hypot(east, north) < TOLERANCE_M:
            self.corners.pop(0)
            self.get_logger().info(f"{len(self.corners)} corners to go")
            if not self.corners:
                self.finish()
            return
        yaw = 2.0 * math.atan2(turned.z, turned.w)
        scale = min(GAIN, self.speed / math.hypot(east, north))
        twist = Twist()
        twist.linear.x = scale * (math.cos(yaw) * east + math.sin(yaw) * north)
        twist.linear.y = scale * (math.cos(yaw) * north - math.sin(yaw) * east)
        self.command.publish(twist)

    def finish(self):
        """Land; the program ends when that is under way."""
        self.done = True
        self.command.publish(Twist())
        self.land.call_async(Trigger.Request()).add_done_callback(lambda _: rclpy.shutdown())


def main():
    """Fly until the square is closed."""
    rclpy.init()
    rclpy.spin(FlySquare())


if __name__ == "__main__":
    main()
