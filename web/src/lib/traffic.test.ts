import { describe, expect, it } from "vitest";
import { bytesText, TrafficMeter } from "./traffic.ts";

describe("a meter of traffic", () => {
  it("returns the rate of the last seconds", () => {
    const meter = new TrafficMeter(3000);
    for (let ms = 0; ms <= 10_000; ms += 25) meter.add(ms, 100);
    const { hz, bytesPerS, bytes } = meter.read(10_000);
    expect(hz).toBeCloseTo(40, 0);
    expect(bytesPerS).toBeCloseTo(4000, -2);
    expect(bytes).toBe(100);
  });

  it("is right from the second message on", () => {
    const meter = new TrafficMeter(3000);
    for (let ms = 0; ms <= 500; ms += 100) meter.add(1e12 + ms, 8);
    expect(meter.read(1e12 + 500).hz).toBeCloseTo(10);
  });

  it("falls to nothing when nothing comes", () => {
    const meter = new TrafficMeter(1000);
    meter.add(0, 10);
    expect(meter.read(5000)).toEqual({ hz: 0, bytesPerS: 0, bytes: NaN });
  });

  it("writes sizes for people", () => {
    expect([0, 999, 1234, 56_789, 4.2e6, 1e9].map(bytesText)).toEqual([
      "0 B",
      "999 B",
      "1.23 kB",
      "56.8 kB",
      "4.20 MB",
      "1.00 GB",
    ]);
    expect(bytesText(NaN)).toBe("–");
  });
});
