"""Flies a UAV from an external program with roslibpy over rosbridge, like any ROS robot.

volery run hover --seconds 60 --bridge rosbridge
python examples/06_fly_over_rosbridge.py            # pip install roslibpy
"""

import sys
import time

import roslibpy

port = int(sys.argv[1]) if len(sys.argv) > 1 else 9090
side_s = float(sys.argv[2]) if len(sys.argv) > 2 else 3.0

ros = roslibpy.Ros("127.0.0.1", port)
try:
    ros.run()
except roslibpy.core.RosTimeoutError:
    sys.exit(
        f"no rosbridge at port {port}; start: volery run hover --seconds 60 --bridge rosbridge"
    )
roslibpy.Service(ros, "/uav1/take_off", "std_srvs/srv/Trigger").call(roslibpy.ServiceRequest())
time.sleep(4.0)

positions = []
odometry = roslibpy.Topic(ros, "/uav1/odom", "nav_msgs/msg/Odometry")
odometry.subscribe(lambda message: positions.append(message["pose"]["pose"]["position"]))
command = roslibpy.Topic(ros, "/uav1/cmd_vel", "geometry_msgs/msg/Twist")
for x, y in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)):
    for _ in range(round(10 * side_s)):  # without commands the UAV holds
        command.publish(roslibpy.Message({"linear": {"x": x, "y": y}}))
        time.sleep(0.1)
xs = [position["x"] for position in positions]
print(f"flew a square, {max(xs) - min(xs):.1f} m wide")
ros.terminate()
