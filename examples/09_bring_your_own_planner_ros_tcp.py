"""Flies a UAV with an external planner over ROS-TCP, the protocol of Unity's ROS-TCP-Connector.

volery run plug_in --seconds 600 --bridge ros-tcp
python examples/09_bring_your_own_planner_ros_tcp.py

The program uses the standard library only; any language with sockets works. A frame is a
destination and a payload, each preceded by its length as a little-endian uint32. Commands have
destinations that begin with __ and JSON payloads; all other payloads are messages in ROS 1
serialization.
"""

import json
import socket
import struct
import sys
import time

port = int(sys.argv[1]) if len(sys.argv) > 1 else 10000
waypoints = int(sys.argv[2]) if len(sys.argv) > 2 else 4
uav, height_m = "uav1", 2.5

try:
    link = socket.create_connection(("127.0.0.1", port), timeout=30.0)
except ConnectionRefusedError:
    sys.exit(f"no server at port {port}; start: volery run plug_in --bridge ros-tcp")
stream = link.makefile("rb")


def send(destination, payload):
    name = destination.encode()
    link.sendall(struct.pack("<I", len(name)) + name + struct.pack("<I", len(payload)) + payload)


def command(name, **fields):
    send(f"__{name}", json.dumps(fields).encode())


def receive():
    """Returns the next frame: destination and payload."""
    (length,) = struct.unpack("<I", stream.read(4))
    destination = stream.read(length).decode()
    (length,) = struct.unpack("<I", stream.read(4))
    return destination, stream.read(length)


def wait_for(wanted):
    while True:
        destination, payload = receive()
        if destination == "__error":
            text = json.loads(payload)["text"]
            if not text.startswith(f"/{uav}/goal_pose"):  # refused during take-off: see below
                sys.exit(text)
        if destination == wanted:
            return payload


def after_header(payload):
    """Returns the offset of the first field after the header: seq, stamp and frame_id."""
    (length,) = struct.unpack_from("<I", payload, 12)
    return 16 + length


def call_trigger(service, number):
    command("request", srv_id=number)
    send(service, b"")
    wait_for("__response")
    receive()  # the response itself: success and a reason


# 1. The map: load time, resolution, width, height, origin (7 doubles), then the cells.
command("subscribe", topic="/map", message_name="nav_msgs/OccupancyGrid")
grid = wait_for("/map")
at = after_header(grid) + 8
side_m, width, height, x0, y0, *_ = struct.unpack_from("<fII7d", grid, at)
(count,) = struct.unpack_from("<I", grid, at + 68)
cells = struct.unpack_from(f"<{count}b", grid, at + 72)
print(f"map of {width} x {height} cells, {cells.count(0)} free")

# 2. The position of the UAV: after the header, the child frame's name, then x, y, z.
odometry = f"/{uav}/odom"
command("subscribe", topic=odometry, message_name="nav_msgs/Odometry")


def position():
    payload = wait_for(odometry)
    at = after_header(payload)
    (length,) = struct.unpack_from("<I", payload, at)
    return struct.unpack_from("<3d", payload, at + 4 + length)


# 3. Your planner. Here: along the UAV's row, as far as it is free, and back.
x, y, _ = position()
row, first = int((y - y0) / side_m), int((x - x0) / side_m)
last = first
while last + 1 < width and not cells[row * width + last + 1]:
    last += 1
plan = [last, first] * waypoints

# 4. Take off, then one waypoint after the other.
command("ros_service", topic=f"/{uav}/take_off", message_name="std_srvs/Trigger")
while position()[2] < 1.0:  # refused during a landing: repeat until the UAV is airborne
    call_trigger(f"/{uav}/take_off", 101)
    time.sleep(0.5)
command("publish", topic=f"/{uav}/goal_pose", message_name="geometry_msgs/PoseStamped")
header = struct.pack("<III", 0, 0, 0) + struct.pack("<I", 3) + b"map"
for column in plan[:waypoints]:
    goal = (x0 + (column + 0.5) * side_m, y0 + (row + 0.5) * side_m, height_m)
    ticks = 0
    while max(abs(a - b) for a, b in zip(position(), goal, strict=True)) > 0.4:
        if ticks % 25 == 0:  # goals are refused during take-off: repeat
            send(f"/{uav}/goal_pose", header + struct.pack("<7d", *goal, 0.0, 0.0, 0.0, 0.0))
        ticks += 1
    print(f"reached row {row}, column {column}")
command("ros_service", topic=f"/{uav}/land", message_name="std_srvs/Trigger")
call_trigger(f"/{uav}/land", 102)
