"""Idioms of published node files."""

import rclpy
import tf2_ros
from geometry_msgs.msg import PointStamped, TransformStamped
from rclpy.node import Node
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String
from tf2_ros import Buffer, TransformException, TransformListener
from tf2_ros.transform_broadcaster import TransformBroadcaster
from tf_transformations import euler_from_quaternion, quaternion_from_euler


class Idioms(Node):
    def __init__(self):
        super().__init__("idioms")
        self.seen = {"time": rclpy.time.Time(seconds=7).nanoseconds}
        self.seen["qos"] = rclpy.qos.QoSProfile(depth=1).depth
        self.seen["sim"] = self.get_parameter("use_sim_time").value
        self.buffer = Buffer()
        self.listener = TransformListener(self.buffer, self)
        self.broadcaster = TransformBroadcaster(self)
        self.out = self.create_publisher(String, "note", 1)
        self.scans = self.create_publisher(LaserScan, "probe", 1)
        self.create_subscription(LaserScan, "probe", self.on_scan, 1)
        self.create_timer(0.1, self.tick)

    def tick(self):
        self.scans.publish(LaserScan(ranges=[1.0, 2.0, 3.0, 4.0, 5.0]))
        self.seen["nodes"] = self.get_node_names()
        self.seen["count"] = self.count_publishers("note"), self.count_subscribers("note")
        self.seen["msg_type"] = self.out.msg_type is String
        moved = TransformStamped()
        moved.header.stamp = self.get_clock().now().to_msg()
        moved.header.frame_id, moved.child_frame_id = "/map", "probe"
        moved.transform.translation.x = 2.0
        q = quaternion_from_euler(0.0, 0.0, 1.0)
        moved.transform.rotation.z, moved.transform.rotation.w = q[2], q[3]
        self.broadcaster.sendTransform(moved)
        try:
            t = self.buffer.lookup_transform("map", "probe", rclpy.time.Time())
        except TransformException:
            return
        q = t.transform.rotation
        self.seen["yaw"] = euler_from_quaternion([q.x, q.y, q.z, q.w])[2]
        point = PointStamped()
        point.header.frame_id = "map"
        self.seen["x"] = t.transform.translation.x
        self.seen["inside"] = self.buffer.transform(point, "probe").point.y
        try:
            self.buffer.lookup_transform("map", "moon", rclpy.time.Time())
        except tf2_ros.LookupException as error:
            self.seen["moon"] = str(error)

    def on_scan(self, scan):
        r = scan.ranges
        self.seen["slices"] = len(r[:3] + r[-3:]), not r, r.index(r[0])
        scan.ranges[0] = 0.0


class Typed(Node):
    def __init__(self):
        super().__init__("typed")
        self.out = self.create_publisher(String, "note", 1)
        self.create_timer(0.1, self.tick)

    def tick(self):
        message = String()
        message.data = 7
        self.out.publish(message)


class Waiting(Node):
    def __init__(self):
        super().__init__("waiting")
        self.create_rate(10)
