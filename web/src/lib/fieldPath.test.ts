import { describe, expect, it } from "vitest";
import { join, numberOf, pathsIn, stepsOf, valueAt } from "./fieldPath.ts";

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

  it("leads into JSON", () => {
    const status = { data: '{"cost": 0.25, "parts": {"upwash": 3}, "ranks": [[7, 8]], "a.b": 1}' };
    expect(valueAt(status, stepsOf("data.cost"))).toBe(0.25);
    expect(valueAt(status, stepsOf("data.ranks[0][1]"))).toBe(8);
    expect(valueAt({ data: "{broken" }, stepsOf("data.cost"))).toBeUndefined();
    expect(valueAt({ data: "text" }, stepsOf("data.length"))).toBeUndefined();
    expect(pathsIn(status)).toEqual(["data.cost", "data.parts.upwash", "data.ranks[0][0]"]);
    expect(pathsIn({ data: "none" })).toEqual([]);
  });

  it("gives a number where there is one", () => {
    expect(numberOf(true)).toBe(1);
    expect(numberOf(12n)).toBe(12);
    expect(numberOf("3")).toBeNaN();
    expect(numberOf(null)).toBeNaN(); // JSON's NaN
  });
});
