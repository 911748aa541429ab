import { create } from "zustand";
import { link } from "../link/link.ts";
import { useConnection } from "./connection.ts";

/** `volery_interfaces/msg/PlayerState`. */
export interface Player {
  position: number;
  start: number;
  end: number;
  /** As of a simulation: 0 at the start, 1 playing, 2 paused. */
  state: number;
  /** Seconds of the log a second; 0: as fast as possible. */
  speed: number;
  loop: boolean;
  /** Whether the server can return to a simulation. */
  can_close: boolean;
}

/** The recorded log that is shown; null: a simulation is. */
export const usePlayer = create<{ player: Player | null }>(() => ({ player: null }));

export function followPlayer(): void {
  link.subscribe(
    "/volery/player/state",
    "volery_interfaces/msg/PlayerState",
    ({ message }: { message: unknown }) => usePlayer.setState({ player: message as Player }),
  );
  // With a new connection it may be another world: only a player says that it is one.
  useConnection.subscribe(({ state }, before) => {
    if (state === "open" && before.state !== "open") usePlayer.setState({ player: null });
  });
}
