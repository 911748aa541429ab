import { afterEach, beforeEach, expect, it, vi } from "vitest";

const sent = vi.hoisted(() => [] as [string, number, number][]);
vi.mock("../link/commands/flight.ts", () => ({
  fly: (uav: string, twist: { linear: { x: number }; angular: { z: number } }) =>
    sent.push([uav, twist.linear.x, twist.angular.z]),
  stopFlying: (uav: string) => sent.push([uav, 0, 0]),
}));
vi.mock("../link/link.ts", () => ({ link: { subscribe: () => () => undefined } }));

const { addSource, releaseControls, rest, setSpeeds, takeControls } = await import("./flying.ts");
const { useVehicles } = await import("./vehicles.ts");

let ahead = 0;
let forget: () => void;

beforeEach(() => {
  vi.useFakeTimers();
  sent.length = ahead = 0;
  setSpeeds({ level: 3 });
  useVehicles.setState({ selected: "uav1" });
  forget = addSource(() => ({ ahead }));
});

afterEach(() => {
  releaseControls();
  forget();
  vi.useRealTimers();
});

it("sends a velocity 20 times a second while a key is held, and zero once at the end", () => {
  takeControls("uav1");
  vi.advanceTimersByTime(500);
  expect(sent).toEqual([]);
  ahead = 1;
  vi.advanceTimersByTime(1000);
  expect(sent).toEqual(Array(20).fill(["uav1", 3, 0]));
  ahead = 0;
  vi.advanceTimersByTime(1000);
  expect(sent.slice(20)).toEqual([["uav1", 0, 0]]);
});

it("rests when the window loses its focus", () => {
  takeControls("uav1");
  ahead = -1;
  vi.advanceTimersByTime(50);
  rest();
  rest();
  expect(sent).toEqual([
    ["uav1", -3, 0],
    ["uav1", 0, 0],
  ]);
});

it("gives the controls back, at rest, when another UAV is selected", () => {
  takeControls("uav1");
  ahead = 1;
  vi.advanceTimersByTime(100);
  useVehicles.setState({ selected: "uav2" });
  vi.advanceTimersByTime(500);
  expect(sent.at(-1)).toEqual(["uav1", 0, 0]);
  expect(sent.length).toBe(3);
});
