"""Flies a UAV with an external planner that receives the map and sends waypoints over rosbridge.

volery run plug_in --seconds 600 --bridge rosbridge
python examples/09_bring_your_own_planner.py            # pip install roslibpy

The program does not import Volery. Its planner is minimal: the UAV flies the first rows of the map
back and forth, as far as they are free.
"""

import sys
import threading

import roslibpy

port = int(sys.argv[1]) if len(sys.argv) > 1 else 9090
waypoints = int(sys.argv[2]) if len(sys.argv) > 2 else 6
uav, height_m = "uav1", 2.5

ros = roslibpy.Ros("127.0.0.1", port)
try:
    ros.run()
except roslibpy.core.RosTimeoutError:
    sys.exit(f"no rosbridge at port {port}; start: volery run plug_in --bridge rosbridge")

# 1. The map: nav_msgs/OccupancyGrid on /map, latched, so it arrives at once.
maps, arrived = [], threading.Event()
roslibpy.Topic(ros, "/map", "nav_msgs/msg/OccupancyGrid").subscribe(
    lambda message: (maps.append(message), arrived.set())
)
if not arrived.wait(20.0):
    sys.exit("no map received")
info, cells = maps[0]["info"], maps[0]["data"]
width, side_m = info["width"], info["resolution"]
corner = info["origin"]["position"]
print(f"map of {width} x {info['height']} cells, {cells.count(0)} free")

# 2. The position of the UAV: nav_msgs/Odometry.
place, moved = {}, threading.Event()


def on_odometry(message):
    place.update(message["pose"]["pose"]["position"])
    moved.set()


roslibpy.Topic(ros, f"/{uav}/odom", "nav_msgs/msg/Odometry").subscribe(on_odometry)
if not moved.wait(20.0):
    sys.exit("no odometry received")

# 3. Your planner: cells to visit, in order. Here: free cells, row by row from the UAV's own cell.
column = int((place["x"] - corner["x"]) / side_m)
row = int((place["y"] - corner["y"]) / side_m)
plan = []
while row < info["height"] and len(plan) < waypoints and not cells[row * width + column]:
    step = 1 if len(plan) % 4 == 0 else -1
    plan.append((row, column))
    while 0 <= column + step < width and not cells[row * width + column + step]:
        column += step
    plan.append((row, column))
    row += 1

# 4. Take off, then one waypoint after the other: geometry_msgs/PoseStamped on /uavN/goal_pose.
take_off = roslibpy.Service(ros, f"/{uav}/take_off", "std_srvs/srv/Trigger")
while place["z"] < 1.0:  # refused during a landing: repeat until the UAV is airborne
    take_off.call(roslibpy.ServiceRequest())
    threading.Event().wait(0.5)
goal = roslibpy.Topic(ros, f"/{uav}/goal_pose", "geometry_msgs/msg/PoseStamped")
for row, column in plan[:waypoints]:
    x, y = corner["x"] + (column + 0.5) * side_m, corner["y"] + (row + 0.5) * side_m
    pose = {"position": {"x": x, "y": y, "z": height_m}}
    while max(abs(x - place["x"]), abs(y - place["y"]), abs(height_m - place["z"])) > 0.4:
        goal.publish(roslibpy.Message({"header": {"frame_id": "map"}, "pose": pose}))
        moved.clear()  # goals are refused during take-off: repeat until the UAV arrives
        moved.wait(1.0)
        threading.Event().wait(0.2)
    print(f"reached row {row}, column {column}")
roslibpy.Service(ros, f"/{uav}/land", "std_srvs/srv/Trigger").call(roslibpy.ServiceRequest())
ros.terminate()
