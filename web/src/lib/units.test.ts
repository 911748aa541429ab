import { expect, it } from "vitest";
import { axisText, isLength, unitOf } from "./units.ts";

it.each([
  ["pose.pose.position.x", "nav_msgs/msg/Odometry", "m"],
  ["twist.twist.linear.x", "nav_msgs/msg/Odometry", "m/s"],
  ["twist.twist.angular.z", "nav_msgs/msg/Odometry", "rad/s"],
  ["linear.x", "geometry_msgs/msg/Twist", "m/s"],
  ["linear.x", "geometry_msgs/msg/Accel", "m/s²"],
  ["accel.linear.x", "geometry_msgs/msg/AccelStamped", "m/s²"],
  ["linear_acceleration.z", "sensor_msgs/msg/Imu", "m/s²"],
  ["angular_velocity.z", "sensor_msgs/msg/Imu", "rad/s"],
  ["vehicles[0].position.z", "volery_interfaces/msg/VehicleStates", "m"],
  ["ranges[3]", "sensor_msgs/msg/LaserScan", "m"],
  ["altitude", "sensor_msgs/msg/NavSatFix", "m"],
  ["position[0]", "sensor_msgs/msg/JointState", ""], // m or rad
  ["velocity[0]", "sensor_msgs/msg/JointState", ""],
  ["pose.pose.orientation.w", "nav_msgs/msg/Odometry", ""],
  ["vehicles[0].rotor_speed", "volery_interfaces/msg/VehicleStates", ""],
])("%s of %s is in %s", (path, type, unit) => expect(unitOf(path, type)).toBe(unit));

it("an axis says what it shows", () => {
  const of = (path: string) => ({ path, type: "nav_msgs/msg/Odometry" });
  const [x, y] = [of("pose.pose.position.x"), of("pose.pose.position.y")];
  expect(axisText([x, x])).toBe("position.x, m");
  expect(axisText([x, y])).toBe("x; y, m");
  expect(axisText([x, of("twist.twist.linear.y")])).toBe("x; y");
  expect(axisText([of("data")])).toBe("data");
  expect(axisText([])).toBe("");
  expect(isLength("pose.pose.position.x")).toBe(true);
  expect(isLength("twist.twist.linear.x")).toBe(false);
});
