import { expect, it } from "vitest";
import { alikeCurves, positionCurve } from "./usualCurves.ts";

const ODOMETRY = "nav_msgs/msg/Odometry";
const TOPICS = [
  { name: "/clock", type: "rosgraph_msgs/msg/Clock" },
  { name: "/uav1/ground_truth/odom", type: ODOMETRY },
  { name: "/uav1/odom", type: ODOMETRY },
  { name: "/uav2/imu", type: "sensor_msgs/msg/Imu" },
  { name: "/uav2/odom", type: ODOMETRY },
  { name: "/robot/odometry", type: ODOMETRY },
];

it("a plot begins with the path of the selected UAV, seen from above", () => {
  const [curve, ...more] = positionCurve(TOPICS, "uav1");
  expect(more).toEqual([]);
  expect(curve!.x).toEqual({ topic: "/uav1/odom", type: ODOMETRY, path: "pose.pose.position.x" });
  expect(curve!.y.path).toBe("pose.pose.position.y");
  expect(positionCurve(TOPICS, "robot")[0]!.y.topic).toBe("/robot/odometry");
  expect(positionCurve(TOPICS, "uav9")).toEqual([]);
});

it("the same curve of every UAV needs the same topic of the same type", () => {
  const [curve] = positionCurve(TOPICS, "uav2");
  const topics = alikeCurves(TOPICS, curve!).map(({ x, y }) => [x.topic, y.topic]);
  expect(topics).toEqual([["/uav1/odom", "/uav1/odom"], ["/uav2/odom", "/uav2/odom"]]); // prettier-ignore
});

it("a curve of two UAVs is alike to itself only", () => {
  const [curve] = positionCurve(TOPICS, "uav1");
  const mixed = { x: curve!.x, y: { ...curve!.y, topic: "/uav2/odom" } };
  expect(alikeCurves(TOPICS, mixed)).toEqual([mixed]);
});
