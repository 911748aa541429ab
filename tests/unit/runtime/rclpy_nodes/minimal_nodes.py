"""Nodes as tutorials of rclpy have them: nothing of Volery is imported."""

import rclpy
from example_interfaces.srv import AddTwoInts
from geometry_msgs.msg import Twist, Vector3
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String


class Talker(Node):
    """Publishes a counted text twice a second."""

    def __init__(self):
        super().__init__("talker")
        self.publisher_ = self.create_publisher(String, "chatter", 10)
        self.timer = self.create_timer(0.5, self.timer_callback)
        self.count = 0

    def timer_callback(self):
        msg = String()
        msg.data = f"hello {self.count}"
        self.publisher_.publish(msg)
        self.get_logger().info(f"publishing {msg.data!r}")
        self.count += 1


class Listener(Node):
    """Subscribes, with parameters that may be set while it runs."""

    def __init__(self):
        super().__init__("listener")
        description = ParameterDescriptor(description="what comes before the text")
        self.declare_parameter("prefix", "heard", description)
        self.declare_parameter("speed", 1.0)
        self.add_on_set_parameters_callback(self.on_set)
        profile = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
        profile.durability = DurabilityPolicy.VOLATILE
        self.subscription = self.create_subscription(
            String, "chatter", self.listener_callback, profile
        )
        self.command = self.create_publisher(Twist, "cmd_vel", qos_profile=profile)
        self.lines = []

    def listener_callback(self, msg):
        prefix = self.get_parameter("prefix").get_parameter_value().string_value
        speed = self.get_parameter("speed").value
        self.lines.append(f"{prefix} {msg.data}")
        self.get_logger().info(self.lines[-1])
        self.command.publish(Twist(linear=Vector3(x=speed)))
        if len(self.lines) == 1:
            changed = Parameter("prefix", Parameter.Type.STRING, "again")
            self.set_parameters([changed])

    def on_set(self, parameters):
        for parameter in parameters:
            if parameter.name == "speed" and parameter.value > 2.0:
                return SetParametersResult(successful=False, reason="too fast")
        return SetParametersResult(successful=True)


class AddServer(Node):
    """Adds two numbers for others."""

    def __init__(self):
        super().__init__("add_server")
        self.srv = self.create_service(AddTwoInts, "add_two_ints", self.add_callback)

    def add_callback(self, request, response):
        response.sum = request.a + request.b
        return response


class AddClient(Node):
    """Has numbers added, each second, by a service that it waits for at its start."""

    def __init__(self):
        super().__init__("add_client")
        self.cli = self.create_client(AddTwoInts, "add_two_ints")
        while not self.cli.wait_for_service(timeout_sec=1.0):
            self.get_logger().info("service not available, waiting again...")
        self.req = AddTwoInts.Request()
        self.sums = []
        self.timer = self.create_timer(1.0, self.send_request)

    def send_request(self):
        self.req.a += 1
        self.req.b = 41
        future = self.cli.call_async(self.req)
        future.add_done_callback(self.on_response)

    def on_response(self, future):
        self.sums.append(future.result().sum)
        stamp = self.get_clock().now().to_msg()
        self.get_logger().info(f"{self.sums[-1]} at {stamp.sec}")


def main(args=None):
    try:
        with rclpy.init(args=args):
            rclpy.spin(Talker())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
