import { describe, expect, it } from "vitest";
import { Frames } from "../../link/frames.ts";
import { ShownPoses } from "./shown.ts";

function frames(): Frames {
  const made = new Frames();
  made.rename({ names: ["uav1/base_link"], fixed: [] });
  return made;
}

function publish(to: Frames, x: number, arrivedMs: number, quaternion = [0, 0, 0, 1]): void {
  const poses = Float64Array.from([x, 0, 1, ...quaternion]);
  to.move({ poses, stampS: arrivedMs / 1000, arrivedMs });
}

/** When message `i` of 30 a second comes, ms: up to 3 ms early or late. */
function arrival(i: number): number {
  return (1000 * i) / 30 + 3 * Math.sin(12.9 * i);
}

describe("shown poses", () => {
  it("begin with the first message", () => {
    const [source, shown] = [frames(), new ShownPoses()];
    publish(source, 3, 1000);
    shown.update(source, 1000);
    expect(shown.poses[0]).toBe(3);
  });

  it("move evenly at 30 Hz: no frame of the screen stands still or leaps", () => {
    const [source, shown] = [frames(), new ShownPoses()];
    const speed = 3; // m/s
    const steps: number[] = [];
    let before = NaN;
    let count = 0;
    for (let nowMs = 5; nowMs < 4000; nowMs += 1000 / 60) {
      for (; arrival(count) <= nowMs; count++)
        publish(source, (speed * count) / 30, arrival(count));
      shown.update(source, nowMs);
      if (nowMs > 2000) steps.push(shown.poses[0]! - before);
      before = shown.poses[0]!;
    }
    const even = speed / 60;
    for (const step of steps) expect(Math.abs(step - even)).toBeLessThan(0.35 * even);
  });

  it("are at most a period late and never ahead of what is known", () => {
    const [source, shown] = [frames(), new ShownPoses()];
    let truth = 0;
    for (let i = 0; i <= 60; i++) {
      truth = i * 0.1;
      publish(source, truth, i * 33);
      for (const after of [0, 11, 22, 32]) {
        shown.update(source, i * 33 + after);
        expect(shown.poses[0]).toBeLessThanOrEqual(truth + 1e-9);
        if (i > 30) expect(shown.poses[0]).toBeGreaterThanOrEqual(truth - 0.1 * 1.05);
      }
    }
    shown.update(source, 60 * 33 + 5000);
    expect(shown.poses[0]).toBeCloseTo(truth, 9);
  });

  it("leap where the UAV was teleported", () => {
    const [source, shown] = [frames(), new ShownPoses()];
    publish(source, 0, 0);
    shown.update(source, 0);
    publish(source, 50, 33);
    shown.update(source, 34);
    expect(shown.poses[0]).toBe(50);
  });

  it("turn by the shorter angle and stay of unit length", () => {
    const [source, shown] = [frames(), new ShownPoses()];
    const half = Math.SQRT1_2;
    publish(source, 0, 0, [0, 0, half, half]);
    shown.update(source, 0);
    publish(source, 0, 33, [0, 0, -1, 0]); // 180 degrees, published with the other sign
    shown.update(source, 33 + 16);
    const [z, w] = [shown.poses[5]!, shown.poses[6]!];
    expect(Math.hypot(z, w)).toBeCloseTo(1, 9);
    const yaw = 2 * Math.atan2(z, w);
    expect(yaw).toBeGreaterThan(Math.PI / 2);
    expect(yaw).toBeLessThan(Math.PI);
  });

  it("survive what is no number, and more rows", () => {
    const [source, shown] = [frames(), new ShownPoses()];
    publish(source, NaN, 0);
    shown.update(source, 0);
    publish(source, 2, 33);
    shown.update(source, 50);
    expect(shown.poses[0]).toBe(2);
    source.rename({ names: ["a", "b"], fixed: [] });
    shown.update(source, 60); // the rows have not come yet
    source.move({ poses: new Float64Array(14).fill(1), stampS: 1, arrivedMs: 70 });
    shown.update(source, 70);
    expect(shown.poses.length).toBe(14);
  });
});
