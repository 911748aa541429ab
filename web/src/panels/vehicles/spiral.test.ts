import { expect, it } from "vitest";
import { spiral } from "./spiral.ts";

it("places are apart, begin in the middle and grow outwards", () => {
  const places = spiral(60, 2);
  expect(places[0]).toEqual([0, 0]);
  expect(new Set(places.map(String)).size).toBe(60);
  const rings = places.map(([x, y]) => Math.max(Math.abs(x), Math.abs(y)));
  expect(rings).toEqual(rings.toSorted((a, b) => a - b));
  expect(Math.max(...rings)).toBe(8);
});
