import { expect, test } from "vitest";
import { FrameBox, fittingDistance, type Frame } from "./framing.ts";

test("a frame encloses all points", () => {
  const box = new FrameBox();
  box.clear();
  box.add(0, 0, 1.5);
  box.add(9, 4, 3);
  box.add(5, 2, 2);
  const frame: Frame = { middle: [0, 0, 0], radius: 0 };
  box.measure(frame);
  expect(frame.middle).toEqual([4.5, 2, 2.25]);
  expect(frame.radius).toBeCloseTo(0.5 * Math.hypot(9, 4, 1.5));
});

test("a box without points measures nothing", () => {
  const box = new FrameBox();
  const frame: Frame = { middle: [1, 2, 3], radius: 4 };
  box.measure(frame);
  expect(frame).toEqual({ middle: [1, 2, 3], radius: 4 });
});

test("a sphere fits the narrower side of the view", () => {
  const wide = fittingDistance(5, 55, 1.6);
  const tall = fittingDistance(5, 55, 0.45);
  expect(5 / wide).toBeLessThan(Math.sin((27.5 * Math.PI) / 180));
  expect(5 / tall).toBeLessThan(Math.sin(Math.atan(Math.tan((27.5 * Math.PI) / 180) * 0.45)));
  expect(tall).toBeGreaterThan(wide);
});
