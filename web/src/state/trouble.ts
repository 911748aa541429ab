// Why what is shown may not be live.

import { useRef } from "react";
import { nowMs } from "../lib/time.ts";
import type { LinkState } from "../link/protocol.ts";
import { useConnection } from "./connection.ts";
import { useHealth } from "./health.ts";
import { useSimulation, type ServerStatus } from "./simulation.ts";

export interface Trouble {
  what: string;
  sinceMs: number;
  /** What the page does about it. */
  does: string;
  grave: boolean;
}

/** What is wrong now; null: nothing. */
export function useTrouble(): Trouble | null {
  const { state, reason } = useConnection();
  const silentSinceMs = useHealth((health) => health.silentSinceMs);
  const building = useSimulation(({ server }) => server?.state === "building");
  const sinceMs = useRef(0);
  const told = troubleOf(state, reason, silentSinceMs, building ? "building" : undefined);
  if (told === null) sinceMs.current = 0;
  else if (sinceMs.current === 0) sinceMs.current = silentSinceMs || nowMs();
  return told === null ? null : { ...told, sinceMs: sinceMs.current };
}

export function troubleOf(
  state: LinkState,
  reason: string,
  silentSinceMs: number,
  server: ServerStatus["state"] | undefined,
): Omit<Trouble, "sinceMs"> | null {
  if (state === "refused") {
    return { what: `The server refuses: ${reason}`, does: "It is asked again.", grave: true };
  }
  if (state !== "open" && server === "building") {
    return {
      what: "The world is being built",
      does: "It is shown when it is ready.",
      grave: false,
    };
  }
  if (state !== "open") {
    const does = "It is connected again as soon as the server answers; nothing is set anew.";
    const why = reason === "" ? "" : `: ${reason}`;
    return { what: `The connection is lost${why}`, does, grave: true };
  }
  if (silentSinceMs > 0) {
    const does = "What is shown is the last that came; it goes on by itself.";
    return { what: "The simulation is silent", does, grave: true };
  }
  return null;
}
