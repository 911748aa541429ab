// UAVs that a client puts back to their start: `/volery/reset_uav`, whichever client calls it.

import { create } from "zustand";
import { Restarts } from "../lib/restarts.ts";
import { secondsOf } from "../lib/time.ts";
import { link } from "../link/link.ts";
import { useEpoch } from "./epoch.ts";
import { COMMAND_DEPTH, type Command } from "./journal.ts";
import { useVehicles } from "./vehicles.ts";

/** The UAV that was put back last, and how many were so far. */
export const useRestart = create<{ uav: string; count: number }>(() => ({ uav: "", count: 0 }));

const restarts = new Restarts();
const SERVICE = "/volery/reset_uav";

/** Whether a UAV has no trail now, since it is put back to its start. */
export function isRestarting(uav: string): boolean {
  return !restarts.isEmpty && restarts.includes(uav, link.frames.stampS, performance.now());
}

export function followRestarts(): void {
  link.subscribe(
    "/volery/log",
    "volery_interfaces/msg/CommandRecord",
    ({ message }: { message: unknown }) => {
      const uav = restartedBy(message as Command);
      if (uav !== null) note(uav, secondsOf((message as Command).stamp));
    },
    { depth: COMMAND_DEPTH },
  );
  // Repairs of which there is no record, such as those of a node in the simulation.
  useVehicles.subscribe(({ list }, before) => {
    const wrecks = before.list.filter((vehicle) => vehicle.crashed);
    if (list === before.list || wrecks.length === 0) return;
    const crashed = new Set(wrecks.map(({ name }) => name));
    for (const { name, crashed: still } of list)
      if (!still && crashed.has(name)) note(name, link.frames.stampS);
  });
  useEpoch.subscribe(() => restarts.clear());
}

/** The UAV that a command puts back to its start; null: it does something else. */
export function restartedBy({ kind, name, content }: Command): string | null {
  if (kind !== "call" || name !== SERVICE) return null;
  try {
    const request = JSON.parse(content) as { name?: unknown };
    return typeof request.name === "string" ? request.name : null;
  } catch {
    return null;
  }
}

function note(uav: string, stampS: number): void {
  restarts.note(uav, stampS);
  useRestart.setState(({ count }) => ({ uav, count: count + 1 }));
}
