import { describe, expect, it } from "vitest";
import {
  actionBars,
  descriptionOf,
  extentOf,
  observationBars,
  polyline,
  statusOf,
  withSample,
} from "./policy.ts";

const TEXT = JSON.stringify({
  task: "homing",
  airframe: "f450",
  observation: [
    { name: "goal_heading", size: 3, unit: "m", scale: 3 },
    { name: "rates", size: 2, history: 2, unit: "rad/s" },
  ],
  action: { kind: "discrete_velocity", choices: 7 },
  decision_rate_hz: 5,
});

describe("the description of a policy", () => {
  it("names parts, action and rate", () => {
    const description = descriptionOf(TEXT);
    expect(description?.task).toBe("homing");
    expect(description?.parts[0]).toEqual({
      name: "goal_heading",
      size: 3,
      history: 1,
      unit: "m",
      scale: 3,
    });
    expect(description?.choices).toBe(7);
    expect(description?.rateHz).toBe(5);
  });

  it("is null for other texts", () => {
    expect(descriptionOf("{")).toBeNull();
    expect(descriptionOf("[]")).toBeNull();
    expect(descriptionOf("{}")).toBeNull();
    expect(statusOf("nothing")).toBeNull();
    expect(statusOf('{"state": "holding", "reason": "no goal yet"}')).toEqual({
      state: "holding",
      reason: "no goal yet",
      policy: "",
    });
  });
});

describe("bars", () => {
  const parts = descriptionOf(TEXT)?.parts ?? [];

  it("show the observation by part, in its unit", () => {
    const [goal, rates] = observationBars(parts, [0.5, -1, 0, 1, 2, 3, 4]);
    expect(goal?.bars.map(({ label, text }) => `${label} ${text}`)).toEqual([
      "x 1.50 m",
      "y -3.00 m",
      "z 0.00 m",
    ]);
    expect(rates?.bars.map(({ label }) => label)).toEqual(["1 -1", "2 -1", "1", "2"]);
  });

  it("are none for an observation of another size", () => {
    expect(observationBars(parts, [1, 2])).toEqual([]);
  });

  it("leave out most of an image", () => {
    const image = [{ name: "depth", size: 100, history: 1, unit: "m", scale: 1 }];
    const [group] = observationBars(image, new Float32Array(100));
    expect(group?.bars).toHaveLength(40);
    expect(group?.hidden).toBe(60);
  });

  it("name a choice", () => {
    expect(actionBars({ action: "discrete_velocity", choices: 7 }, [3]).bars[0]?.text).toBe("left");
    expect(actionBars({ action: "velocity", choices: null }, [0.25]).bars[0]?.text).toBe("0.25");
  });

  it("begin in the middle and end at the edges", () => {
    expect(extentOf(0.5)).toEqual({ left: 50, width: 25 });
    expect(extentOf(-4)).toEqual({ left: 0, width: 50 });
    expect(extentOf(NaN)).toEqual({ left: 50, width: 0 });
  });
});

describe("the value over time", () => {
  it("keeps half a minute", () => {
    const kept = withSample([{ timeMs: 0, value: 1 }], { timeMs: 40_000, value: 2 });
    expect(kept).toEqual([{ timeMs: 40_000, value: 2 }]);
  });

  it("is drawn from the lowest to the highest", () => {
    const samples = [
      { timeMs: 0, value: 0 },
      { timeMs: 15_000, value: 2 },
    ];
    expect(polyline(samples, 100, 10)).toBe("50.0,10.0 100.0,0.0");
    expect(polyline([], 100, 10)).toBe("");
  });
});
