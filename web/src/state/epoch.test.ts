import { beforeEach, expect, it, vi } from "vitest";

vi.mock("../link/link.ts", () => ({ link: { subscribe: () => () => undefined, watch: () => 0 } }));
vi.mock("../link/commands/flight.ts", () => ({ goTo: () => Promise.resolve() }));
vi.mock("./worldPlan.ts", () => ({ heightAt: () => 0 }));
vi.mock("./notices.ts", () => ({ succeeds: (_what: string, done: Promise<void>) => done }));
vi.mock("./vehicles.ts", () => ({ baseFrame: (uav: string) => uav }));

const { followEpoch } = await import("./epoch.ts");
const { followGoals, sendTo, useGoals } = await import("./goals.ts");
const { useSimulation } = await import("./simulation.ts");

followEpoch();
followGoals();

type Status = NonNullable<ReturnType<typeof useSimulation.getState>["status"]>;
const setTime = (sec: number) =>
  useSimulation.setState({ status: { stamp: { sec, nanosec: 0 } } as Status });

beforeEach(() => useGoals.setState({}, true));

it("keeps goals while a flight goes on, and forgets them at a reset", async () => {
  setTime(10);
  await sendTo("uav1", { x: 1, y: 2, z: 3 });
  setTime(11);
  expect(useGoals.getState()).toHaveProperty("uav1");
  setTime(0);
  expect(useGoals.getState()).toEqual({});
});

it("forgets goals where another scenario is flown", async () => {
  type Server = NonNullable<ReturnType<typeof useSimulation.getState>["server"]>;
  useSimulation.setState({ server: { scenario: "hover" } as Server });
  setTime(1);
  await sendTo("uav1", { x: 1, y: 2, z: 3 });
  useSimulation.setState({ server: { scenario: "longleaf" } as Server });
  expect(useGoals.getState()).toEqual({});
});
