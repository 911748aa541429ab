"""Records a flight, then reads the log as arrays, as a table of both UAVs, and as a plot."""

import sys

import matplotlib

from volery import Simulation, load_scenario
from volery.bridges.logs.log_writer import create_log
from volery.logs import open_log

matplotlib.use("Agg")  # the plot goes to a file
file = sys.argv[1] if len(sys.argv) > 1 else "flight.mcap"
PAIR = {
    "type": "f450",
    "count": 2,
    "position_m": [0.0, 0.0],
    "last_position_m": [4.0, 0.0],
    "on_start": "take_off",
}

with Simulation(load_scenario("hover").with_(uavs=[PAIR])) as simulation:
    recording = create_log(file, overwrite=True)
    simulation.graph.subscribe_all(recording.write)
    simulation.run(8.0)
    recording.close()

with open_log(file) as log:
    print(log, *log.uavs)
    odometry = log["/uav1/odom"]
    height_m = odometry["pose.pose.position.z"]  # (n,)
    print(f"{len(odometry)} messages, at most {height_m.max():.2f} m high")

    table = log.to_pandas("/*/odom", ["pose.pose.position"])
    print(table.groupby("uav")["pose.pose.position.z"].agg(["min", "mean", "max"]).round(2))

    axes = log.plot("/uav1/odom", "pose.pose.position")
    axes.figure.savefig("position.png")
