import { describe, expect, it } from "vitest";
import { LEVELS, QualityGovernor } from "./quality.ts";

function run(governor: QualityGovernor, frameMs: number, seconds: number): void {
  for (let ms = 0; ms < 1000 * seconds; ms += frameMs) governor.take(frameMs);
}

describe("quality", () => {
  it("goes down within a few seconds where frames are slow", () => {
    const governor = new QualityGovernor(3);
    run(governor, 120, 4);
    expect(governor.level).toBeLessThan(3);
    run(governor, 120, 20);
    expect(governor.level).toBe(0);
  });

  it("goes up where frames are quick, but never back to what was too slow", () => {
    const governor = new QualityGovernor(1);
    run(governor, 16, 30);
    expect(governor.level).toBe(LEVELS.length - 1);
    run(governor, 90, 4);
    const after = governor.level;
    expect(after).toBeLessThan(LEVELS.length - 1);
    run(governor, 16, 60);
    expect(governor.level).toBe(after);
  });

  it("ignores the time in which the page was hidden", () => {
    const governor = new QualityGovernor(2);
    for (let i = 0; i < 50; i++) governor.take(60_000);
    expect(governor.level).toBe(2);
  });
});
