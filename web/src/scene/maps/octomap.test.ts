import { describe, expect, it } from "vitest";
import { occupiedCubes } from "./octomap.ts";

/** A path of children from the root, as bytes of a binary tree: 3 everywhere, at its end `leaf`. */
function path(children: readonly number[], leaf: number): Uint8Array {
  const bytes: number[] = [];
  children.forEach((child, level) => {
    const bits = (level === children.length - 1 ? leaf : 3) << (2 * child);
    bytes.push(bits & 0xff, bits >> 8);
  });
  return Uint8Array.from(bytes);
}

/** The child that holds a point, level by level: bit 0 is x, 1 is y, 2 is z. */
function childrenTo(point: readonly [number, number, number], resolution: number, levels: number) {
  const middle = [0, 0, 0];
  let side = resolution * 65536;
  return Array.from({ length: levels }, () => {
    side /= 2;
    return point.reduce((child, value, axis) => {
      const high = value >= middle[axis]!;
      middle[axis]! += high ? side / 2 : -side / 2;
      return child | (high ? 1 << axis : 0);
    }, 0);
  });
}

describe("octomap", () => {
  it("finds an occupied voxel of the finest level where it is", () => {
    const data = path(childrenTo([1.2, -3.3, 0.7], 0.1, 16), 2);
    const { cubes, count } = occupiedCubes(data, 0.1, true, 10);
    expect(count).toBe(1);
    const [x, y, z, half] = cubes;
    expect(half).toBeCloseTo(0.05, 6);
    for (const [value, wanted] of [
      [x, 1.2],
      [y, -3.3],
      [z, 0.7],
    ])
      expect(Math.abs(value! - wanted!)).toBeLessThanOrEqual(0.05 + 1e-5);
  });

  it("keeps large leaves large and leaves out what is free", () => {
    const coarse = occupiedCubes(path(childrenTo([5, 5, 5], 0.5, 12), 2), 0.5, true, 10);
    expect(coarse.cubes[3]).toBeCloseTo(0.5 * 0.5 * 2 ** 4, 6);
    expect(occupiedCubes(path([7, 0, 3], 1), 0.5, true, 10).count).toBe(0);
  });

  it("reads full trees: log-odds and which children follow", () => {
    const data = new Uint8Array(3 * 5);
    const view = new DataView(data.buffer);
    view.setUint8(4, 0b1000_0001); // two children, 0 and 7
    view.setFloat32(5, 0.85, true);
    view.setFloat32(10, -0.4, true);
    const { cubes, count } = occupiedCubes(data, 0.1, false, 10);
    expect(count).toBe(1);
    expect(cubes[0]).toBeLessThan(0);
  });

  it("survives bytes that end too early, and none", () => {
    const whole = path(childrenTo([1, 1, 1], 0.1, 16), 2);
    for (let length = 0; length < whole.length; length++)
      expect(occupiedCubes(whole.slice(0, length), 0.1, true, 10).count).toBe(0);
    const noise = Uint8Array.from({ length: 3000 }, (_, i) => (i * 73) & 0xff);
    expect(occupiedCubes(noise, 0.1, true, 50).count).toBeLessThanOrEqual(50);
    expect(occupiedCubes(noise, NaN, true, 50).count).toBe(0);
  });
});
