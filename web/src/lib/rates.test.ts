import { describe, expect, it, vi } from "vitest";
import { Latest } from "./latest.ts";
import { ArrivalMeter, RateMeter, ratesText, rateText } from "./rates.ts";

describe("a rate", () => {
  it("is that of the stamps, not of their arrival", () => {
    const meter = new RateMeter();
    expect(meter.hz).toBeNaN();
    for (let i = 0; i < 50; i++) meter.add(5 + i * 0.025);
    expect(meter.hz).toBeCloseTo(40);
  });

  it("begins again after a reset", () => {
    const meter = new RateMeter();
    for (const stamp of [100, 101, 0, 0.5, 1]) meter.add(stamp);
    expect(meter.hz).toBeCloseTo(2);
  });

  it("in wall time is that of the arrivals, and falls while nothing comes", () => {
    const meter = new ArrivalMeter();
    expect(meter.hzAt(0)).toBeNaN();
    for (let i = 0; i < 5; i++) meter.add(10 + i);
    expect(meter.hzAt(14)).toBeCloseTo(1);
    expect(meter.hzAt(15)).toBeCloseTo(1);
    expect(meter.hzAt(20)).toBeCloseTo(0.4);
  });

  it("is shown for both clocks where they differ", () => {
    expect(ratesText(0.7, 10)).toBe("10 Hz simulated, 0.7 Hz real");
    expect(ratesText(9.7, 10)).toBe("10 Hz");
    expect(ratesText(NaN, NaN)).toBe("–");
  });

  it("is shown in short form", () => {
    expect(rateText(NaN)).toBe("–");
    expect(rateText(39.98)).toBe("40 Hz");
    expect(rateText(0.5)).toBe("0.5 Hz");
  });
});

describe("the latest of many wishes", () => {
  it("is sent, others only as often as allowed", async () => {
    vi.useFakeTimers();
    const sent: number[] = [];
    const sender = new Latest<number>(async (value) => void sent.push(value), 100);
    for (let i = 0; i <= 10; i++) {
      sender.offer(i);
      await vi.advanceTimersByTimeAsync(30);
    }
    await vi.advanceTimersByTimeAsync(500);
    expect(sent[0]).toBe(0);
    expect(sent.at(-1)).toBe(10);
    expect(sent.length).toBeLessThanOrEqual(5);
    vi.useRealTimers();
  });

  it("waits for the one before, and goes on after a failure", async () => {
    vi.useFakeTimers();
    const sent: number[] = [];
    let open = 0;
    const sender = new Latest<number>(async (value) => {
      expect(++open).toBe(1);
      await new Promise((resolve) => setTimeout(resolve, 250));
      open--;
      sent.push(value);
      if (value === 0) throw new Error("refused");
    }, 100);
    sender.offer(0);
    await vi.advanceTimersByTimeAsync(50);
    sender.offer(1);
    await vi.advanceTimersByTimeAsync(1000);
    expect(sent).toEqual([0, 1]);
    vi.useRealTimers();
  });
});
