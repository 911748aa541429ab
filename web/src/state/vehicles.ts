import { create } from "zustand";
import { link } from "../link/link.ts";
import type { volery_interfaces_VehicleState as VehicleState } from "../messages/generated.ts";

/** What is known of all UAVs; a few times a second. Poses are in `link.frames`. */
interface Vehicles {
  list: VehicleState[];
  /** Name of the selected UAV; empty: none. */
  selected: string;
}

export const useVehicles = create<Vehicles>(() => ({ list: [], selected: "" }));

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
  useVehicles.setState({ selected: uav });
}

/** Follow what a simulation tells; robots that tell nothing are known by their frames. */
export function followVehicles(volery: boolean): void {
  let told = false;
  link.subscribe("/volery/vehicles", "volery_interfaces/msg/VehicleStates", ({ message }) => {
    told = true;
    take(message.vehicles);
  });
  if (volery) return;
  setInterval(() => {
    if (!told && link.state === "open") take(robots());
  }, ROBOTS_MS);
}

function take(list: VehicleState[]): void {
  useVehicles.setState(({ selected }) => ({
    list,
    selected: list.some(({ name }) => name === selected) ? selected : (list[0]?.name ?? ""),
  }));
}

/** Whoever has a base frame, with what that tells. */
function robots(): VehicleState[] {
  return link.frames.names
    .filter((frame) => frame.endsWith(BASE))
    .map((frame) => {
      const [x, y, z] = link.frames.pose(frame) ?? [NaN, NaN, NaN];
      return { ...UNKNOWN, name: frame.slice(0, -BASE.length), position: { x, y, z } };
    });
}
