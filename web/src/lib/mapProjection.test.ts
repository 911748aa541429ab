import { describe, expect, it } from "vitest";
import {
  AutoFit,
  barLength,
  fitted,
  panned,
  pixelOf,
  positionOf,
  zoomed,
  type Point,
} from "./mapProjection.ts";

const SIZE = { width: 400, height: 300 };
const VIEW = { x: 10, y: -5, scale: 8 };

describe("the map's projection", () => {
  it("has north up and east to the right", () => {
    const [px, py] = pixelOf(VIEW, SIZE, VIEW.x + 1, VIEW.y + 1);
    expect([px, py]).toEqual([208, 142]);
  });

  it("goes there and back", () => {
    const [px, py] = pixelOf(VIEW, SIZE, 3.5, 7.25);
    expect(positionOf(VIEW, SIZE, px, py)).toEqual([3.5, 7.25]);
  });

  it("keeps what is under the pointer while it zooms", () => {
    const before = positionOf(VIEW, SIZE, 37, 251);
    const near = zoomed(VIEW, SIZE, 1.7, 37, 251);
    const after = positionOf(near, SIZE, 37, 251);
    expect(near.scale).toBeCloseTo(13.6);
    expect(after[0]).toBeCloseTo(before[0]);
    expect(after[1]).toBeCloseTo(before[1]);
  });

  it("follows the pointer while it is dragged", () => {
    const before = positionOf(VIEW, SIZE, 100, 100);
    const after = positionOf(panned(VIEW, 20, -30), SIZE, 120, 70);
    expect(after[0]).toBeCloseTo(before[0]);
    expect(after[1]).toBeCloseTo(before[1]);
  });

  it("shows every point when it is fitted", () => {
    const points: [number, number][] = [
      [0, 0],
      [100, 10],
      [50, 200],
    ];
    const view = fitted(points, SIZE);
    for (const [x, y] of points) {
      const [px, py] = pixelOf(view, SIZE, x, y);
      expect(px).toBeGreaterThan(0);
      expect(px).toBeLessThan(SIZE.width);
      expect(py).toBeGreaterThan(0);
      expect(py).toBeLessThan(SIZE.height);
    }
  });

  it("fits again when what is to be seen changes, and holds still between", () => {
    const auto = new AutoFit();
    const empty = auto.of([null, 0], () => [], SIZE);
    const world: Point[] = [
      [0, 0],
      [400, 200],
    ];
    const fit = auto.of(["world", 1], () => world, SIZE);
    expect(fit).not.toEqual(empty);
    expect(fit).toMatchObject({ x: 200, y: 100 });
    expect(auto.of(["world", 1], () => [[7, 7]], SIZE)).toBe(fit);
    auto.clear();
    expect(auto.of(["world", 1], () => [[7, 7]], SIZE)).toMatchObject({ x: 7, y: 7 });
  });

  it("has a scale bar of a round length", () => {
    expect(barLength(8, 100)).toBe(10);
    expect(barLength(3, 100)).toBe(20);
    expect(barLength(0.3, 100)).toBe(200);
    expect(barLength(100, 90)).toBe(0.5);
  });
});
