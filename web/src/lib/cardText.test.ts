import { expect, test } from "vitest";
import { contentsOf } from "./cardText.ts";

test("a card says what is in a scenario", () => {
  const contents = contentsOf({
    uavs: 3,
    airframes: ["f450", "iris"],
    sensors: ["battery", "ground_truth", "imu", "lidar", "odometry"],
    world: "grid_map",
    duration_s: 300,
  });
  expect(contents).toEqual({
    uavs: "3 UAVs: f450, iris",
    sensors: "LIDAR, IMU",
    world: "grid map, 5 min",
  });
});

test("a card of one UAV without sensors", () => {
  const contents = contentsOf({
    uavs: 1,
    airframes: ["crazyflie"],
    sensors: ["ground_truth"],
    world: "open",
    duration_s: 30,
  });
  expect(contents).toEqual({
    uavs: "1 UAV: crazyflie",
    sensors: "no sensors",
    world: "open ground, 30 s",
  });
});
