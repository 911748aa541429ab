// Counts what is flown: a reset, another scenario and a moved playback begin a new epoch.

import { create } from "zustand";
import { continues, type Instant } from "../lib/continuity.ts";
import { secondsOf } from "../lib/time.ts";
import { usePlayer } from "./player.ts";
import { useSimulation } from "./simulation.ts";

/** Trails and goals belong to one epoch. */
export const useEpoch = create<{ epoch: number }>(() => ({ epoch: 0 }));

export function followEpoch(): void {
  let before: Instant | null = null;
  const look = () => {
    const now = present();
    if (now === null) return;
    if (before !== null && !continues(before, now)) {
      useEpoch.setState(({ epoch }) => ({ epoch: epoch + 1 }));
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
  if (player !== null) return { scenario, timeS: player.position, playback: true };
  if (status === null) return null;
  return { scenario, timeS: secondsOf(status.stamp), playback: false };
}
