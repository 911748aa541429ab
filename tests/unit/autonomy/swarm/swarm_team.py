"""UAVs under nodes of the swarm."""

import json

import numpy as np
from node_bench import NodeBench, odometry

from volery.graph.messages import Twist

PERIOD_S = 0.05


class ObedientUavs(NodeBench):
    """UAVs at positions (N, 3) m that follow their velocity commands at once."""

    def __init__(self, positions):
        super().__init__()
        self.positions = np.array(positions, float)
        self.names = [f"uav{k + 1}" for k in range(len(self.positions))]
        self.velocities = np.zeros_like(self.positions)
        self.silent = set()
        for row, name in enumerate(self.names):
            topic = f"/{name}/cmd_vel"
            self.graph.subscribe(topic, lambda p, row=row: self._obey(row, p.message), Twist)

    def _obey(self, row, twist):
        self.velocities[row] = twist.linear.x, twist.linear.y, twist.linear.z

    def fly(self, seconds):
        for _ in range(round(seconds / PERIOD_S)):
            time_ns = self.now_ns + round(PERIOD_S * 1e9)
            self.positions += self.velocities * PERIOD_S
            for row, name in enumerate(self.names):
                if row not in self.silent:
                    at = odometry(time_ns, self.positions[row], self.velocities[row])
                    self.send(f"/{name}/odom", at)
            self.run_to(time_ns)


class SwarmTeam(ObedientUavs):
    """A team under one node.

    The node flies all of them, unless its parameter `uavs` names others.
    """

    def __init__(self, node, positions, **parameters):
        super().__init__(positions)
        self.node = self.start(node, **{"uavs": self.names} | parameters)
        self.statuses = self.listen(f"{self.node.full_name}/status")

    @property
    def status(self):
        return json.loads(self.statuses[-1].data)

    def fly_until(self, condition, seconds=300.0):
        for _ in range(round(seconds)):
            self.fly(1.0)
            if self.statuses and condition(self.status):
                return
        raise AssertionError(self.status)
