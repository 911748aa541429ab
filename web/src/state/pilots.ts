// Who steers a UAV when several pilots are there.

import { create } from "zustand";
import { keep, readKept } from "../lib/kept.ts";
import { takeControl } from "../link/commands/pilots.ts";
import { link } from "../link/link.ts";
import { useVehicles } from "./vehicles.ts";

interface Pilot {
  /** What the simulation calls this page; empty: not known before it has taken a UAV. */
  name: string;
  /** What the user wants to be called. */
  wished: string;
}

const KEY = "volery.pilot";

export const usePilot = create<Pilot>(() => ({ name: "", ...readKept(KEY, { wished: "" }) }));

export function callMe(wished: string): void {
  usePilot.setState({ wished });
  keep(KEY, { wished });
}

/** Take the control of a UAV under the wished name, or the one that was given already. */
export async function take(uav: string): Promise<void> {
  const { name, wished } = usePilot.getState();
  usePilot.setState({ name: await takeControl(uav, holds(name) ? "" : wished) });
}

/** Who else has the control of a UAV; empty: nobody but this page. */
export function useStranger(uav: string): string {
  const holder = useVehicles(({ list }) => list.find(({ name }) => name === uav)?.holder ?? "");
  const own = usePilot(({ name }) => name);
  return holder === own ? "" : holder;
}

/** Leaving lets go of every UAV, and who comes back may be called otherwise. */
export function followLeaving(): void {
  link.watch(() => {
    if (link.state !== "open") usePilot.setState({ name: "" });
  });
}

function holds(name: string): boolean {
  return name !== "" && useVehicles.getState().list.some(({ holder }) => holder === name);
}
