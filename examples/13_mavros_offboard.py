"""Flies a UAV with a MAVROS offboard program over rosbridge, without Volery's packages.

volery run plug_in --uavs 1 --bridge mavlink --bridge rosbridge
python examples/13_mavros_offboard.py            # pip install roslibpy
"""

import math
import sys
import time

import roslibpy

port = int(sys.argv[1]) if len(sys.argv) > 1 else 9090
ros = roslibpy.Ros("127.0.0.1", port)
try:
    ros.run()
except roslibpy.core.RosTimeoutError:
    sys.exit(f"no rosbridge at port {port}; start: volery run plug_in --bridge rosbridge")
heard = {}
for name, kind in {
    "state": "mavros_msgs/State",
    "local_position/pose": "geometry_msgs/PoseStamped",
}.items():
    topic = roslibpy.Topic(ros, f"/mavros/{name}", kind)
    topic.subscribe(lambda message, name=name: heard.update({name: message}))
setpoints = roslibpy.Topic(ros, "/mavros/setpoint_position/local", "geometry_msgs/PoseStamped")


def call(name, kind, **fields):
    return roslibpy.Service(ros, f"/mavros/{name}", kind).call(roslibpy.ServiceRequest(fields))


def position():
    return [heard["local_position/pose"]["pose"]["position"][axis] for axis in "xyz"]


def stream(goal, seconds, near_m=0.0):
    """Publishes a setpoint at 20 Hz for `seconds`, or until the UAV is within `near_m` of it."""
    setpoint = roslibpy.Message({"pose": {"position": dict(zip("xyz", goal, strict=True))}})
    for _ in range(round(20 * seconds)):
        if math.dist(position(), goal) < near_m:
            return
        setpoints.publish(setpoint)
        time.sleep(0.05)


while not heard.get("state", {}).get("connected") or "local_position/pose" not in heard:
    time.sleep(0.1)
x, y, z = position()
stream((x, y, z + 2.0), 1.0)  # offboard mode requires a stream of setpoints before it starts
call("set_mode", "mavros_msgs/SetMode", base_mode=0, custom_mode="OFFBOARD")
call("cmd/arming", "mavros_msgs/CommandBool", value=True)
stream((x, y, z + 2.0), 60.0, near_m=0.04)
print(f"{heard['state']['mode']}, {position()[2] - z:.1f} m up")
stream((x + 3.0, y, z + 2.0), 60.0, near_m=0.04)
print(f"{position()[0] - x:.1f} m ahead")
call("set_mode", "mavros_msgs/SetMode", base_mode=0, custom_mode="AUTO.LAND")
while heard["state"]["armed"]:
    time.sleep(0.1)
print("landed and disarmed")
ros.terminate()
