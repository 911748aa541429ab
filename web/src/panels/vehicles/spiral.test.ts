import { expect, it } from "vitest";
import { spiral } from "./spiral.ts";

it("positions are apart, begin in the middle and grow outwards", () => {
  const positions = spiral(60, 2);
  expect(positions[0]).toEqual([0, 0]);
  expect(new Set(positions.map(String)).size).toBe(60);
  const rings = positions.map(([x, y]) => Math.max(Math.abs(x), Math.abs(y)));
  expect(rings).toEqual(rings.toSorted((a, b) => a - b));
  expect(Math.max(...rings)).toBe(8);
});
