import { expect, it } from "vitest";
import { matcher } from "./filter.ts";

it("a text matches when it contains every word, in any order and case", () => {
  expect(matcher("ODOM uav1")("/uav1/odom nav_msgs/msg/Odometry")).toBe(true);
  expect(matcher("odom uav2")("/uav1/odom nav_msgs/msg/Odometry")).toBe(false);
  expect(matcher(" ")("anything")).toBe(true);
});
