import { describe, expect, it } from "vitest";
import { ClockOffset } from "./clockOffset.ts";
import { quantile } from "./quantile.ts";

describe("the offset of two clocks", () => {
  it("is that of the quickest exchange", () => {
    const offset = new ClockOffset();
    expect(offset.ms).toBeNaN();
    // The page is 250 ms ahead; the slow exchange waits 80 ms on its way there.
    offset.add({ sentMs: 1000, serverMs: 830, receivedMs: 1084 });
    offset.add({ sentMs: 2000, serverMs: 1753, receivedMs: 2006 });
    offset.add({ sentMs: 3000, serverMs: 2790, receivedMs: 3050 });
    expect(offset.ms).toBeCloseTo(250);
    expect(offset.errorMs).toBeCloseTo(3);
  });

  it("follows clocks that drift: old exchanges are forgotten", () => {
    const offset = new ClockOffset(2);
    offset.add({ sentMs: 0, serverMs: 0, receivedMs: 0 });
    for (const ms of [1000, 2000]) {
      offset.add({ sentMs: ms, serverMs: ms - 10, receivedMs: ms + 4 });
    }
    expect(offset.ms).toBeCloseTo(12);
  });
});

describe("a quantile", () => {
  it("lies between the values", () => {
    expect(quantile([4, 1, 3, 2], 0.5)).toBeCloseTo(2.5);
    expect(quantile([5], 0.95)).toBe(5);
    expect(quantile([], 0.5)).toBeNaN();
    const many = Array.from({ length: 101 }, (_, i) => 100 - i);
    expect(quantile(many, 0.95)).toBeCloseTo(95);
  });
});
