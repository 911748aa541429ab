import { expect, it } from "vitest";
import { Restarts } from "./restarts.ts";

it("a UAV is on the way to its start until its poses are those of the new start", () => {
  const restarts = new Restarts();
  restarts.note("uav1", 10);
  expect(restarts.includes("uav2", 9, 0)).toBe(false);
  expect(restarts.includes("uav1", 9.9, 0)).toBe(true); // poses from before the command
  expect(restarts.includes("uav1", 10, 5000)).toBe(true); // paused: none has come since
  expect(restarts.includes("uav1", 10.02, 5100)).toBe(true); // on its way in the scene
  expect(restarts.includes("uav1", 10.9, 5700)).toBe(false);
  expect(restarts.includes("uav1", 10.9, 5701)).toBe(false);
});

it("a reset of all ends it", () => {
  const restarts = new Restarts();
  restarts.note("uav1", 10);
  restarts.clear();
  expect(restarts.includes("uav1", 0, 0)).toBe(false);
});
