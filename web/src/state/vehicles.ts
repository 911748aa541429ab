import { create } from "zustand";
import { useShallow } from "zustand/react/shallow";
import { link } from "../link/link.ts";
import type { volery_interfaces_VehicleState as VehicleState } from "../messages/generated.ts";

/** What is known of all UAVs; a few times a second. Poses are in `link.frames`. */
interface Vehicles {
  list: VehicleState[];
  /** Name of the selected UAV; empty: none. */
  selected: string;
  /** Names of UAVs that are selected together, `selected` among them; empty, or two and more. */
  group: readonly string[];
}

export const useVehicles = create<Vehicles>(() => ({ list: [], selected: "", group: [] }));

/** Names of all UAVs: the same array until another UAV is among them. */
export function useVehicleNames(): string[] {
  return useVehicles(useShallow(({ list }) => list.map(({ name }) => name)));
}

const BASE = "/base_link";
const ROBOTS_MS = 500;
const UNKNOWN: VehicleState = {
  name: "",
  airframe: "robot",
  type: "",
  mode: "",
  airborne: false,
  crashed: false,
  battery: NaN,
  voltage: NaN,
  position: { x: 0, y: 0, z: 0 },
  velocity: { x: NaN, y: NaN, z: NaN },
  rotor_speed: 0,
  command_age: -1,
  operator: "",
};

/** Base frame of a UAV. */
export function baseFrame(uav: string): string {
  return uav + BASE;
}

export function select(uav: string): void {
  useVehicles.setState({ selected: uav, group: [] });
}

/** Select UAVs together; of none, nothing changes. */
export function selectGroup(uavs: readonly string[]): void {
  if (uavs.length === 0) return;
  useVehicles.setState(({ selected }) => ({
    selected: uavs.includes(selected) ? selected : uavs[0]!,
    group: uavs.length > 1 ? uavs : [],
  }));
}

/** Select one UAV more, or one less. */
export function toggleSelected(uav: string): void {
  const uavs = allSelected();
  const others = uavs.filter((name) => name !== uav);
  selectGroup(others.length < uavs.length ? others : [...uavs, uav]);
}

/** All UAVs that are selected. */
export function allSelected(): readonly string[] {
  const { group, selected } = useVehicles.getState();
  if (group.length > 0) return group;
  return selected === "" ? [] : [selected];
}

/** Follow the vehicles that a simulation publishes; other robots are known by their frames. */
export function followVehicles(volery: boolean): void {
  let received = false;
  link.subscribe("/volery/vehicles", "volery_interfaces/msg/VehicleStates", ({ message }) => {
    received = true;
    take(message.vehicles);
  });
  if (volery) return;
  setInterval(() => {
    if (!received && link.state === "open") take(robots());
  }, ROBOTS_MS);
}

function take(list: VehicleState[]): void {
  useVehicles.setState(({ selected, group }) => {
    const names = new Set(list.map(({ name }) => name));
    const kept = group.every((name) => names.has(name))
      ? group
      : group.filter((name) => names.has(name));
    return {
      list,
      selected: names.has(selected) ? selected : (kept[0] ?? list[0]?.name ?? ""),
      group: kept.length > 1 ? kept : [],
    };
  });
}

/** Every robot with a base frame, at the pose of that frame. */
function robots(): VehicleState[] {
  return link.frames.names
    .filter((frame) => frame.endsWith(BASE))
    .map((frame) => {
      const [x, y, z] = link.frames.pose(frame) ?? [NaN, NaN, NaN];
      return { ...UNKNOWN, name: frame.slice(0, -BASE.length), position: { x, y, z } };
    });
}
