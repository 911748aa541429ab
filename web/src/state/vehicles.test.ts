import { beforeEach, expect, it, vi } from "vitest";
import type { volery_interfaces_VehicleState as VehicleState } from "../messages/generated.ts";

let publish: (received: { message: { vehicles: Partial<VehicleState>[] } }) => void;
vi.mock("../link/link.ts", () => ({
  link: {
    subscribe: (_topic: string, _type: string, listener: typeof publish) => (publish = listener),
  },
}));

const { allSelected, followVehicles, select, selectGroup, toggleSelected, useVehicles } =
  await import("./vehicles.ts");
followVehicles(true);

function flying(...names: string[]): void {
  publish({ message: { vehicles: names.map((name) => ({ name })) } });
}

beforeEach(() => {
  flying("uav1", "uav2", "uav3", "uav4");
  select("uav2");
});

it("the selected UAV is one of its group, and a group has two and more", () => {
  selectGroup(["uav3", "uav4"]);
  expect(useVehicles.getState()).toMatchObject({ selected: "uav3", group: ["uav3", "uav4"] });
  selectGroup(["uav1", "uav3"]);
  expect(useVehicles.getState().selected).toBe("uav3");
  selectGroup(["uav4"]);
  expect(useVehicles.getState()).toMatchObject({ selected: "uav4", group: [] });
  selectGroup([]);
  expect(useVehicles.getState().selected).toBe("uav4");
});

it("one UAV more, one less", () => {
  toggleSelected("uav4");
  expect(allSelected()).toEqual(["uav2", "uav4"]);
  toggleSelected("uav1");
  toggleSelected("uav2");
  expect(useVehicles.getState()).toMatchObject({ selected: "uav4", group: ["uav4", "uav1"] });
  toggleSelected("uav4");
  expect(useVehicles.getState()).toMatchObject({ selected: "uav1", group: [] });
  toggleSelected("uav1");
  expect(allSelected()).toEqual(["uav1"]); // the last one stays
});

it("UAVs that are removed leave the group", () => {
  selectGroup(["uav1", "uav2", "uav4"]);
  const { group } = useVehicles.getState();
  flying("uav1", "uav2", "uav3", "uav4");
  expect(useVehicles.getState().group).toBe(group);
  flying("uav1", "uav3", "uav4");
  expect(useVehicles.getState()).toMatchObject({ selected: "uav1", group: ["uav1", "uav4"] });
  flying("uav3", "uav4");
  expect(useVehicles.getState()).toMatchObject({ selected: "uav4", group: [] });
});
