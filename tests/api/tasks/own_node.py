"""Flies every UAV on a circle with a node of its own."""

import volery
from volery.graph.messages import Twist, Vector3


class Circling(volery.Node):
    def __init__(self):
        super().__init__("circling")
        self.command = self.create_publisher(Twist, "cmd_vel", 1)
        self.create_timer(0.1, self.on_timer)

    def on_timer(self):
        self.command.publish(Twist(Vector3(1.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.5)))


with volery.make("hover", {"types.*.nodes": [{"node": Circling}]}) as run:
    run.run(10.0)
    print(run.uavs["uav1"].velocity_map)
