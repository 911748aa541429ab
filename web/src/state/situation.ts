import type { LinkState } from "../link/protocol.ts";
import type { ServerStatus } from "./simulation.ts";

export type Situation = "token_needed" | "building" | "failed" | "no_world" | "ended" | "flying";

/**
 * Returns what the page shows over the scene; "flying": at most a problem of the connection.
 *
 * A server that stops reports "building" or "no_world" in its last second: only a server that
 * still answers is shown so.
 */
export function situationOf(
  server: ServerStatus | null,
  reachable: boolean,
  link: LinkState,
  ended: boolean,
): Situation {
  if (server?.token_needed === true || link === "refused") return "token_needed";
  if (reachable && server !== null && server.state !== "flying" && server.state !== "ended")
    return server.state;
  return link === "open" && ended ? "ended" : "flying";
}
