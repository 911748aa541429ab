import { expect, test } from "vitest";
import { continues, isSameRun, type Instant } from "./continuity.ts";

const flight: Instant = { scenario: "a", timeS: 10, playback: false };
const log: Instant = { ...flight, playback: true };

test("a flight that goes on continues, however fast", () => {
  expect(continues(flight, { ...flight, timeS: 10.2 })).toBe(true);
  expect(continues(flight, { ...flight, timeS: 500 })).toBe(true);
  expect(continues(flight, flight)).toBe(true);
});

test("a reset, another scenario and a log are something else", () => {
  expect(continues(flight, { ...flight, timeS: 0 })).toBe(false);
  expect(continues(flight, { ...flight, scenario: "b" })).toBe(false);
  expect(continues(flight, log)).toBe(false);
});

test("a log whose position is moved begins again", () => {
  expect(continues(log, { ...log, timeS: 12 })).toBe(true);
  expect(continues(log, { ...log, timeS: 60 })).toBe(false);
  expect(continues(log, { ...log, timeS: 9 })).toBe(false);
});

test("a reset and a moved position are the same run, another world and another log are not", () => {
  expect(isSameRun(flight, { ...flight, timeS: 0 })).toBe(true);
  expect(isSameRun({ ...log, log: [0, 20] }, { ...log, timeS: 3, log: [0, 20] })).toBe(true);
  expect(isSameRun({ ...log, log: [0, 20] }, { ...log, log: [0, 35] })).toBe(false);
  expect(isSameRun(flight, log)).toBe(false);
  expect(isSameRun(flight, { ...flight, scenario: "b" })).toBe(false);
});
