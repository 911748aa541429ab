import { describe, expect, it } from "vitest";
import { join, numberOf, stepsOf, valueAt } from "./fieldPath.ts";

const ODOMETRY = { pose: { pose: { position: { x: 1, z: 2.5 } } }, ranges: Float32Array.of(4, 5) };

describe("a path of fields", () => {
  it("names fields and elements", () => {
    expect(stepsOf("pose.pose.position.z")).toEqual(["pose", "pose", "position", "z"]);
    expect(stepsOf("poses[12].position")).toEqual(["poses", 12, "position"]);
    expect(stepsOf("")).toEqual([]);
  });

  it("is what a tree joins step by step", () => {
    expect(["poses", 3, "x"].reduce<string>(join, "")).toBe("poses[3].x");
    expect(stepsOf(join(join("a", "b"), 7))).toEqual(["a", "b", 7]);
  });

  it("leads to a value, also in typed arrays, or to nothing", () => {
    expect(valueAt(ODOMETRY, stepsOf("pose.pose.position.z"))).toBe(2.5);
    expect(valueAt(ODOMETRY, stepsOf("ranges[1]"))).toBe(5);
    expect(valueAt(ODOMETRY, stepsOf("pose.twist.x"))).toBeUndefined();
    expect(valueAt(null, stepsOf("x"))).toBeUndefined();
  });

  it("gives a number where there is one", () => {
    expect(numberOf(true)).toBe(1);
    expect(numberOf(12n)).toBe(12);
    expect(numberOf("3")).toBeNaN();
    expect(numberOf(null)).toBeNaN(); // JSON's NaN
  });
});
