import { afterEach, beforeEach, expect, it, vi } from "vitest";
import { LEASE_MS, Streams } from "./streams.ts";

const TOPIC = "/uav1/cmd_vel";
let sent: unknown[];
let streams: Streams;

const order = (message: unknown) => ({ topic: TOPIC, type: "Twist", message, rest: "rest" });

beforeEach(() => {
  vi.useFakeTimers();
  sent = [];
  streams = new Streams((_topic, _type, message) => sent.push(message), Date.now);
});

afterEach(() => {
  vi.useRealTimers();
});

it("adds nothing to a stream that is renewed in time", () => {
  for (let i = 0; i < 20; i++) {
    streams.renew(order(i));
    vi.advanceTimersByTime(50);
  }
  streams.end(TOPIC);
  vi.advanceTimersByTime(5000);
  expect(sent).toEqual([...Array(20).keys(), "rest"]);
});

it("goes on through a pause of the page", () => {
  streams.renew(order("ahead"));
  vi.advanceTimersByTime(500);
  expect(sent.length).toBeGreaterThan(8);
  expect(new Set(sent)).toEqual(new Set(["ahead"]));
});

it("rests when the page does not come back, and goes on when it does", () => {
  streams.renew(order("ahead"));
  vi.advanceTimersByTime(LEASE_MS + 100);
  expect(sent.at(-1)).toBe("rest");
  const before = sent.length;
  vi.advanceTimersByTime(10_000);
  expect(sent.length).toBe(before);
  streams.renew(order("left"));
  expect(sent.at(-1)).toBe("left");
});

it("says nothing more of what was dropped, and rests once", () => {
  streams.renew(order("ahead"));
  streams.drop();
  vi.advanceTimersByTime(5000);
  expect(sent).toEqual(["ahead"]);
  streams.renew(order("ahead"));
  streams.end(TOPIC);
  streams.end(TOPIC);
  expect(sent).toEqual(["ahead", "ahead", "rest"]);
});
