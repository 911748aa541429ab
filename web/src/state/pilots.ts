// Who steers a UAV when several pilots are there.

import { create } from "zustand";
import { useVehicles } from "./vehicles.ts";

/** Name under which the simulation knows this page; empty: not known. */
export const usePilot = create(() => ({ name: "" }));

/** Who else has the control of a UAV; empty: nobody but this page. */
export function useStranger(uav: string): string {
  const holder = useVehicles(({ list }) => list.find(({ name }) => name === uav)?.holder ?? "");
  const own = usePilot(({ name }) => name);
  return holder === own ? "" : holder;
}
