// Problems of the connection: why the data on the screen is not live.

import { useRef } from "react";
import { nowMs } from "../lib/time.ts";
import type { LinkState } from "../link/protocol.ts";
import { useConnection } from "./connection.ts";
import { useSilence } from "./silence.ts";

export interface Problem {
  what: string;
  /** The reaction of the page. */
  does: string;
  /** Whether the page is connected. */
  linked: boolean;
}

export interface CurrentProblem extends Problem {
  sinceMs: number;
}

/** Returns the present problem and its start; null: none. */
export function useProblem(): CurrentProblem | null {
  const { state, reason, url, volery } = useConnection();
  const silentMs = useSilence(({ sinceMs }) => sinceMs);
  const begun = useRef(0);
  const problem = problemOf(state, reason, volery ? "the simulation" : url, silentMs > 0);
  if (problem === null) {
    begun.current = 0;
    return null;
  }
  begun.current ||= silentMs || nowMs();
  return { ...problem, sinceMs: begun.current };
}

export function problemOf(
  state: LinkState,
  reason: string,
  other: string,
  silent: boolean,
): Problem | null {
  if (state !== "open") {
    const why = reason === "" ? "" : `: ${reason}`;
    const does = "The page shows the last data received and reconnects automatically.";
    return { what: `No connection to ${other}${why}`, does, linked: false };
  }
  if (!silent) return null;
  const does = "The page shows the last data received and resumes automatically.";
  return { what: `No data from ${other}`, does, linked: true };
}
