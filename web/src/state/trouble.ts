// Why what is shown is not live.

import { useRef } from "react";
import { nowMs } from "../lib/time.ts";
import type { LinkState } from "../link/protocol.ts";
import { useConnection } from "./connection.ts";
import { useSilence } from "./silence.ts";

export interface Told {
  what: string;
  /** What the page does about it. */
  does: string;
  /** Whether the link stands. */
  linked: boolean;
}

export interface Trouble extends Told {
  sinceMs: number;
}

/** What is wrong now, and since when; null: nothing. */
export function useTrouble(): Trouble | null {
  const { state, reason, url, volery } = useConnection();
  const silentMs = useSilence(({ sinceMs }) => sinceMs);
  const begun = useRef(0);
  const told = troubleOf(state, reason, volery ? "the simulation" : url, silentMs > 0);
  if (told === null) {
    begun.current = 0;
    return null;
  }
  begun.current ||= silentMs || nowMs();
  return { ...told, sinceMs: begun.current };
}

export function troubleOf(
  state: LinkState,
  reason: string,
  other: string,
  silent: boolean,
): Told | null {
  if (state !== "open") {
    const why = reason === "" ? "" : `: ${reason}`;
    const does = "The page shows the last data received and reconnects automatically.";
    return { what: `No connection to ${other}${why}`, does, linked: false };
  }
  if (!silent) return null;
  const does = "The page shows the last data received and resumes automatically.";
  return { what: `No data from ${other}`, does, linked: true };
}
