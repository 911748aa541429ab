import { expect, it } from "vitest";
import { onLevel, onUpright, type Ray } from "./dragging.ts";

const DOWN_EAST: Ray = { origin: [0, 0, 10], direction: [Math.SQRT1_2, 0, -Math.SQRT1_2] };

it("a pointer drags over the level plane", () => {
  const [x, y] = onLevel(DOWN_EAST, 4)!;
  expect(x).toBeCloseTo(6);
  expect(y).toBe(0);
  expect(onLevel(DOWN_EAST, 12)).toBeNull();
  expect(onLevel({ origin: [0, 0, 10], direction: [1, 0, -1e-4] }, 4)).toBeNull();
});

it("a pointer lifts along the upright line", () => {
  expect(onUpright(DOWN_EAST, 7, 3)).toBeCloseTo(3);
  expect(onUpright({ origin: [0, 0, 10], direction: [0, 0, -1] }, 0, 0)).toBeNull();
  expect(onUpright(DOWN_EAST, -5, 0)).toBeNull();
});
