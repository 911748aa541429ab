// Counts what is flown: a reset, another scenario and a moved playback begin a new epoch.

import { create } from "zustand";
import { continues, isSameRun, type Instant } from "../lib/continuity.ts";
import { secondsOf } from "../lib/time.ts";
import { usePlayer } from "./player.ts";
import { useSimulation } from "./simulation.ts";

/**
 * Trails and goals belong to one epoch. What is plotted belongs to one run: a reset and a moved
 * playback change only the time, and points that are later then drop out by themselves.
 */
export const useEpoch = create<{ epoch: number; run: number }>(() => ({ epoch: 0, run: 0 }));

export function followEpoch(): void {
  let before: Instant | null = null;
  const look = () => {
    const now = present();
    if (now === null) return;
    if (before !== null && !continues(before, now)) {
      const other = isSameRun(before, now) ? 0 : 1;
      useEpoch.setState(({ epoch, run }) => ({ epoch: epoch + 1, run: run + other }));
    }
    before = now;
  };
  useSimulation.subscribe(look);
  usePlayer.subscribe(look);
}

/** What is shown; null while nothing is known of it. */
function present(): Instant | null {
  const { server, status } = useSimulation.getState();
  const { player } = usePlayer.getState();
  const scenario = server?.scenario ?? null;
  if (player !== null) {
    const { position: timeS, start, end } = player;
    return { scenario, timeS, playback: true, log: [start, end] };
  }
  if (status === null) return null;
  return { scenario, timeS: secondsOf(status.stamp), playback: false };
}
