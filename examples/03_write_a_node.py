"""Runs a custom node that flies a circle, and climbs if the sonar range is short."""

from volery import Simulation
from volery.graph.messages import Range, Twist, Vector3
from volery.graph.nodes.node import Node
from volery.scenario.load import parse_scenario


class Circle(Node):
    def __init__(self, **options):
        super().__init__("circle", **options)
        self.speed = self.declare_parameter("speed_m_s", 1.0).value
        self.below = float("inf")
        self.create_subscription(Range, "range", self.on_range, 5)
        self.command = self.create_publisher(Twist, "cmd_vel", 1)
        self.take_off = self.create_client("std_srvs/srv/Trigger", "take_off")
        self.create_timer(0.1, self.on_timer)

    def on_range(self, message):
        self.below = message.range

    def on_timer(self):
        now_s = self.get_clock().now_ns() / 1e9
        if now_s < 5.0:
            if now_s < 0.15:
                self.take_off.call()
            return
        climb = 0.5 if self.below < 2.0 else 0.0
        self.command.publish(Twist(Vector3(self.speed, 0.0, climb), Vector3(0.0, 0.0, 0.5)))


scenario = parse_scenario(
    {
        "name": "circle",
        "types": {
            "f450": {
                "sensors": [{"kind": "sonar", "rpy_deg": [0.0, 90.0, 0.0]}],
                "nodes": [{"node": f"{__name__}:Circle", "parameters": {"speed_m_s": 1.5}}],
            }
        },
        "uavs": [{"type": "f450", "position_m": [0.0, 0.0]}],
    }
)

if __name__ == "__main__":
    with Simulation(scenario) as simulation:
        for _ in range(4):
            simulation.run(5.0)
            x, y, z = simulation.uavs["uav1"].position_map
            print(f"{simulation.time_s:4.1f} s  x {x:6.2f}  y {y:6.2f}  z {z:5.2f}")
