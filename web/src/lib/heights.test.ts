import { describe, expect, it } from "vitest";
import { heightIn, heightsOf, meetGround } from "./heights.ts";

/** A slope of 1 in 10 towards the east over 100 m x 50 m, as two triangles. */
const SLOPE = new Float32Array([0, 0, 0, 100, 0, 10, 100, 50, 10, 0, 0, 0, 100, 50, 10, 0, 50, 0]);

describe("heights", () => {
  const slope = heightsOf(SLOPE, 100)!;

  it("are those of the surface", () => {
    expect([slope.columns, slope.rows, slope.cell]).toEqual([100, 50, 1]);
    for (const x of [0.5, 33.5, 99.5]) expect(heightIn(slope, x, 20.5)).toBeCloseTo(x / 10, 5);
    expect(heightIn(slope, 101, 20)).toBeNaN();
    expect(slope.z.some(Number.isNaN)).toBe(false);
  });

  it("are of the highest surface where there are several", () => {
    const roof = new Float32Array([10, 10, 30, 30, 10, 30, 10, 30, 30]);
    const both = heightsOf(new Float32Array([...roof, ...SLOPE]), 100)!;
    expect(heightIn(both, 12.5, 12.5)).toBeCloseTo(30);
    expect(heightIn(both, 40.5, 12.5)).toBeCloseTo(4.05);
  });

  it("need triangles", () => {
    expect(heightsOf(new Float32Array(0), 10)).toBeNull();
  });
});

describe("a ray", () => {
  const hill = (x: number, y: number) => 8 * Math.exp(-((x - 50) ** 2 + y ** 2) / 200);

  it("meets the ground where it stands", () => {
    const down = Math.SQRT1_2;
    const [x, y, z] = meetGround(() => 2, [0, 0, 12], [down, 0, -down])!;
    expect(x).toBeCloseTo(10, 3);
    expect(y).toBe(0);
    expect(z).toBeCloseTo(2, 3);
  });

  it("meets the near side of a hill, not what is behind", () => {
    const length = Math.hypot(50, 1);
    const [x, , z] = meetGround(hill, [0, 0, 5], [50 / length, 0, -1 / length])!;
    expect(x).toBeLessThan(50);
    expect(z).toBeCloseTo(hill(x, 0), 3);
  });

  it("into the sky meets nothing", () => {
    expect(meetGround(hill, [0, 0, 5], [0, 0, 1])).toBeNull();
  });
});
