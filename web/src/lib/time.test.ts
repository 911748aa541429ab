import { expect, it } from "vitest";
import { clockText, hourText, secondsOf, spanText, timeOfDay } from "./time.ts";

it("clocks have minutes, seconds and tenths", () => {
  expect(clockText(83.46)).toBe("1:23.4");
  expect(clockText(0)).toBe("0:00.0");
  expect(clockText(-5.25)).toBe("-0:05.2");
});

it("spans are short", () => {
  expect([0.44, 12.3, 200, 8000, Infinity].map(spanText)).toEqual([
    "0.4 s",
    "12 s",
    "3 min",
    "2 h",
    "–",
  ]);
});

it("hours of the day are as on a clock", () => {
  expect([0.25, 16.5, 24].map(hourText)).toEqual(["0:15", "16:30", "0:00"]);
});

it("times of both generations are read", () => {
  expect(secondsOf({ sec: 3, nanosec: 500_000_000 })).toBe(3.5);
  expect(secondsOf({ secs: 3, nsecs: 250_000_000 })).toBe(3.25);
});

it("wall time is shown on a clock of 24 hours", () => {
  expect(timeOfDay(new Date(2024, 4, 1, 16, 5, 9).getTime())).toBe("16:05:09");
  expect(timeOfDay(new Date(2024, 4, 1, 0, 30, 0).getTime())).toBe("00:30:00");
});
