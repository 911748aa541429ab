import { describe, expect, it } from "vitest";
import { landAround } from "./beyond.ts";

/** A square of 100 m, two triangles, its north-east corner 6 m high. */
const SQUARE = Float64Array.from(
  [0, 0, 0, 100, 0, 0, 100, 100, 6].concat([0, 0, 0, 100, 100, 6, 0, 100, 0]),
);

describe("the land around", () => {
  const land = landAround(SQUARE)!;
  const position = land.getAttribute("position");
  const share = land.getAttribute("base");

  it("begins at the border at its height and ends far outside, level", () => {
    for (let i = 0; i < position.count; i++) {
      const [x, y, z] = [position.getX(i), position.getY(i), position.getZ(i)];
      const outside = Math.max(-x, x - 100, -y, y - 100);
      if (share.getX(i) === 0) {
        expect(outside).toBeCloseTo(0, 9);
        expect(z).toBe(x === 100 && y === 100 ? 6 : 0);
      } else expect(z).toBeCloseTo(1.5, 6);
      if (share.getX(i) === 1) expect(outside).toBeGreaterThan(1000);
    }
  });

  it("covers all around and faces upwards", () => {
    const normal = land.getAttribute("normal");
    for (let i = 0; i < normal.count; i++) expect(normal.getZ(i)).toBeGreaterThan(0.9);
    expect(land.index!.count).toBe(4 * 4 * 3);
  });

  it("is left out where the border is no rectangle", () => {
    expect(landAround(new Float64Array(0))).toBeNull();
    expect(landAround(Float64Array.from([0, 0, 0, 10, 5, 0, 3, 10, 0]))).toBeNull();
  });
});
