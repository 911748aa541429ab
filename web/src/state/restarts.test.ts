import { beforeEach, expect, it, vi } from "vitest";

type Listener = (received: { message: unknown }) => void;
const listeners = new Map<string, Listener>();
const link = {
  frames: { stampS: 0 },
  subscribe: (topic: string, _type: string, listener: Listener) => listeners.set(topic, listener),
  watch: () => 0,
};
vi.mock("../link/link.ts", () => ({ link }));
vi.mock("../link/commands/flight.ts", () => ({ goTo: () => Promise.resolve() }));
vi.mock("./worldPlan.ts", () => ({ heightAt: () => 0 }));
vi.mock("./notices.ts", () => ({ succeeds: (_what: string, done: Promise<void>) => done }));

const { followGoals, sendTo, useGoals } = await import("./goals.ts");
const { followRestarts, isRestarting, restartedBy } = await import("./restarts.ts");
const { useVehicles } = await import("./vehicles.ts");

followGoals();
followRestarts();

const call = (name: string, content: string) => ({
  stamp: { sec: 10, nanosec: 0 },
  client: "another client",
  kind: "call",
  name,
  content,
});
const publish = (message: unknown) => listeners.get("/volery/log")!({ message });

beforeEach(async () => {
  await sendTo("uav1", { x: 1, y: 2, z: 3 });
  await sendTo("uav2", { x: 4, y: 5, z: 6 });
});

it("a UAV that any client puts back to its start has neither goal nor trail", () => {
  link.frames.stampS = 9.9;
  publish(call("/volery/reset_uav", '{"name": "uav1"}'));
  expect(Object.keys(useGoals.getState())).toEqual(["uav2"]);
  expect(isRestarting("uav1")).toBe(true);
  expect(isRestarting("uav2")).toBe(false);
});

it("other commands, and what cannot be read, change nothing", () => {
  expect(restartedBy(call("/uav1/go_to", '{"name": "uav1"}'))).toBeNull();
  expect(restartedBy(call("/volery/reset_uav", "{shortened"))).toBeNull();
  expect(restartedBy(call("/volery/reset_uav", "{}"))).toBeNull();
});

it("a repair without a record counts as well", () => {
  type Vehicle = ReturnType<typeof useVehicles.getState>["list"][number];
  const uav = (crashed: boolean) => ({ name: "uav2", crashed }) as Vehicle;
  useVehicles.setState({ list: [uav(true)] });
  useVehicles.setState({ list: [uav(false)] });
  expect(Object.keys(useGoals.getState())).toEqual(["uav1"]);
});
