import { expect, it } from "vitest";
import { END, nextMark, positionOf, SPEED_MARKS, speedOf, speedText } from "./speed.ts";

it("every mark of the speed slider is where it says", () => {
  for (const mark of SPEED_MARKS) expect(speedOf(positionOf(mark))).toBe(mark);
});

it("speeds grow along the slider, and its end is unbounded", () => {
  const speeds = Array.from({ length: 101 }, (_, i) => speedOf(i));
  expect(speeds).toEqual(speeds.toSorted((a, b) => a - b));
  expect(speedOf(END)).toBe(0);
  expect(speedOf(50.9)).toBe(1);
  expect(speedText(0)).toBe("max");
  expect(speedText(0.25)).toBe("0.25 ×");
});

it("keys go from mark to mark", () => {
  expect(nextMark(1, true)).toBe(2);
  expect(nextMark(1.3, false)).toBe(1);
  expect(nextMark(10, true)).toBe(0);
  expect(nextMark(0, false)).toBe(10);
  expect(nextMark(0.1, false)).toBe(0.1);
});
