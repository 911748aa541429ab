import { beforeEach, expect, it, vi } from "vitest";

const row = (name: string) => Number(/\d+/.exec(name)![0]) - 1;
vi.mock("../../link/link.ts", () => ({
  link: { frames: { version: 1, row }, subscribe: () => 0 },
}));

const { select, useVehicles } = await import("../../state/vehicles.ts");
const { fleet } = await import("../uavs/fleet.ts");
const { NearUavs } = await import("./nearUavs.ts");
const { shown } = await import("./shown.ts");

type Vehicle = ReturnType<typeof useVehicles.getState>["list"][number];

beforeEach(() => {
  const list = Array.from({ length: 6 }, (_, i) => ({ name: `uav${i + 1}` }) as Vehicle);
  useVehicles.setState({ list, selected: "uav1" });
  fleet.update();
  shown.poses = Float64Array.from(list.flatMap((_, i) => [10 * i, 0, 2, 0, 0, 0, 1]));
});

function wanted(near: InstanceType<typeof NearUavs>): string[] {
  return fleet.uavs.map(({ name }) => name).filter((name) => near.includes(`/${name}/path`));
}

it("topics of the selected UAV and of those nearest to it, and of what is no UAV", () => {
  const near = new NearUavs(2);
  expect(near.update(0)).toBe(true);
  expect(wanted(near)).toEqual(["uav1", "uav2", "uav3"]);
  expect(near.includes("/plan")).toBe(true);
  shown.poses[7 * 5] = 3; // uav6 comes near
  expect(near.update(100)).toBe(false);
  expect(near.update(600)).toBe(true);
  expect(wanted(near)).toEqual(["uav1", "uav2", "uav6"]);
  expect(near.update(1200)).toBe(false);
});

it("another UAV is selected: at once", () => {
  const near = new NearUavs(1);
  near.update(0);
  select("uav5");
  expect(near.update(1)).toBe(true);
  expect(wanted(near).includes("uav5")).toBe(true);
  expect(wanted(near)).toHaveLength(2);
});
