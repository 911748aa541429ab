import { describe, expect, it } from "vitest";
import { AT_REST, DEAD_ZONE, isAtRest, sum, twistOf, wishOfKeys, wishOfSticks } from "./twist.ts";

const SPEEDS = { level: 4, climb: 2, turn: 1.5 };

describe("keys", () => {
  it("fly in the heading frame: x ahead, y left, z up", () => {
    const { linear, angular } = twistOf(wishOfKeys(["KeyW", "KeyR", "KeyE"]), SPEEDS);
    expect(linear).toEqual({ x: 4, y: 0, z: 2 });
    expect(angular.z).toBe(-1.5);
  });

  it("that oppose each other are at rest", () => {
    expect(isAtRest(wishOfKeys(["KeyA", "KeyD", "ArrowUp", "KeyS"]))).toBe(true);
    expect(wishOfKeys([])).toEqual(AT_REST);
  });

  it("that mean the same are no faster together", () => {
    expect(wishOfKeys(["KeyW", "ArrowUp"]).ahead).toBe(1);
  });

  it("held slantwise keep the speed", () => {
    const { linear } = twistOf(wishOfKeys(["KeyW", "KeyA"]), SPEEDS);
    expect(Math.hypot(linear.x, linear.y)).toBeCloseTo(4);
  });
});

describe("sticks", () => {
  it("are dead in the middle", () => {
    expect(isAtRest(wishOfSticks([DEAD_ZONE / 2, 0.01], [0, -DEAD_ZONE * 0.99]))).toBe(true);
  });

  it("begin at nothing and end at full", () => {
    expect(wishOfSticks([0, 0], [0, -DEAD_ZONE - 0.001]).ahead).toBeLessThan(0.01);
    expect(wishOfSticks([0, 0], [0, -1]).ahead).toBeCloseTo(1);
    expect(wishOfSticks([1, -1], [0, 0])).toMatchObject({
      turn: expect.closeTo(-Math.SQRT1_2),
      up: expect.closeTo(Math.SQRT1_2),
    });
  });

  it("add to keys up to full", () => {
    expect(sum([{ ahead: 0.8 }, { ahead: 1 }]).ahead).toBe(1);
  });
});
