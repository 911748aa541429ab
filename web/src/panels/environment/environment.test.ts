import { expect, it } from "vitest";
import { positionOfVisibility, visibilityOf, visibilityText } from "./visibility.ts";
import { fromDegrees, toDegrees } from "./wind.ts";

it("a west wind blows to the east, a north wind to the south", () => {
  expect(fromDegrees(6, 270)).toMatchObject({ x: expect.closeTo(6), y: expect.closeTo(0) });
  expect(fromDegrees(6, 0)).toMatchObject({ x: 0, y: -6 });
  for (const degrees of [0, 45, 135, 200, 355]) {
    expect(toDegrees(fromDegrees(3, degrees))).toBe(degrees);
  }
});

it("fog thickens along its slider, and its start is clear", () => {
  const sights = Array.from({ length: 100 }, (_, i) => visibilityOf(i + 1));
  expect(visibilityOf(0)).toBe(0);
  expect(sights[0]).toBe(5000);
  expect(sights.at(-1)).toBe(10);
  expect(sights).toEqual(sights.toSorted((a, b) => b - a));
  expect(visibilityOf(positionOfVisibility(120))).toBe(120);
  expect(positionOfVisibility(0)).toBe(0);
  expect([0, 120, 2500].map(visibilityText)).toEqual(["none", "120 m", "2.5 km"]);
});
