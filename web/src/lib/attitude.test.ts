import { expect, test } from "vitest";
import { horizonTransform, MARK_GAP, tapeMarks } from "./attitude.ts";

const RAD = Math.PI / 180;

test("right side down turns the horizon to the left", () => {
  expect(horizonTransform(30 * RAD, 0)).toBe("rotate(-30.00) translate(0 0.00)");
});

test("nose up lowers the horizon: more sky is seen", () => {
  expect(horizonTransform(0, -10 * RAD)).toBe("rotate(0.00) translate(0 14.00)");
});

test("the tape has the altitude in its middle, and higher marks above", () => {
  const marks = tapeMarks(2.5, 5);
  expect(marks.map(({ value }) => value)).toEqual([1, 2, 3, 4, 5]);
  expect(marks[1]!.y).toBeCloseTo(0.5 * MARK_GAP);
  expect(marks[2]!.y).toBeCloseTo(-0.5 * MARK_GAP);
});

test("high up the marks stand farther apart", () => {
  expect(tapeMarks(101, 3).map(({ value }) => value)).toEqual([95, 100, 105]);
});
