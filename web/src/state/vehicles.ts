import { create } from "zustand";
import { link } from "../link/link.ts";
import type { volery_interfaces_VehicleState } from "../messages/generated.ts";

/** What is known of all UAVs; a few times a second. Poses are in `link.frames`. */
interface Vehicles {
  list: volery_interfaces_VehicleState[];
  /** Name of the selected UAV; empty: none. */
  selected: string;
}

export const useVehicles = create<Vehicles>(() => ({ list: [], selected: "" }));

/** Base frame of a UAV. */
export function baseFrame(uav: string): string {
  return `${uav}/base_link`;
}

export function select(uav: string): void {
  useVehicles.setState({ selected: uav });
}

export function followVehicles(): void {
  link.subscribe("/volery/vehicles", "volery_interfaces/msg/VehicleStates", ({ message }) => {
    useVehicles.setState(({ selected }) => ({
      list: message.vehicles,
      selected:
        selected === "" || !message.vehicles.some((v) => v.name === selected)
          ? (message.vehicles[0]?.name ?? "")
          : selected,
    }));
  });
}
