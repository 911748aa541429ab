import { describe, expect, it } from "vitest";
import { DrawingPace } from "./pace.ts";

const TICK_MS = 1000 / 60;

/** Times at which frames begin that take so long to draw, over a second or more. */
function frames(drawingMs: number, seconds = 1): number[] {
  const pace = new DrawingPace();
  const begun: number[] = [];
  for (let tick = 0; tick < 60 * seconds; tick++) {
    const now = tick * TICK_MS;
    if (!pace.mayBegin(now, () => now - begun.at(-1)! >= drawingMs)) continue;
    pace.begin(now);
    begun.push(now);
  }
  return begun;
}

function intervals(times: number[]): number[] {
  return times.slice(1).map((time, i) => time - times[i]!);
}

describe("the pace of drawing by the processor", () => {
  it("draws quick frames thirty times a second", () => {
    expect(frames(3).length).toBeGreaterThanOrEqual(29);
  });

  it("rests after a slow frame nearly as long as it took", () => {
    for (const interval of intervals(frames(150, 5))) {
      expect(interval).toBeGreaterThan(1.7 * 150);
      expect(interval).toBeLessThan(2.1 * 150 + TICK_MS);
    }
  });

  it("rests no longer than a fifth of a second", () => {
    for (const interval of intervals(frames(800, 8))) expect(interval).toBeLessThan(1100);
  });

  it("never has two frames to draw", () => {
    const pace = new DrawingPace();
    expect(pace.mayBegin(0, () => true)).toBe(true);
    pace.begin(0);
    expect(pace.mayBegin(500, () => false)).toBe(false);
    expect(pace.mayBegin(520, () => true)).toBe(false); // it rests
    expect(pace.mayBegin(720, () => true)).toBe(true);
    expect(pace.costMs).toBe(520);
  });

  it("goes on when the context that was drawn to is lost", () => {
    expect(frames(Infinity, 10).length).toBeGreaterThan(5);
  });
});
