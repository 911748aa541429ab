// One command for all selected UAVs.

import { failureText, inWaves } from "../lib/inWaves.ts";
import type { FlightCommand } from "../link/commands/flight.ts";
import { showFailure, succeeds } from "./notices.ts";

/** So many requests wait for an answer at a time: other commands come in between. */
const WIDTH = 32;

/** `return_home` as `return home`. */
export function commandText(command: FlightCommand): string {
  return command.replaceAll("_", " ");
}

/** Give each UAV a command; what fails is one notification. */
export async function commandAll(
  what: string,
  uavs: readonly string[],
  give: (uav: string) => Promise<unknown>,
): Promise<void> {
  if (uavs.length === 1) {
    await succeeds(`${uavs[0]}: ${what}`, give(uavs[0]!));
    return;
  }
  const failed = await inWaves(uavs, WIDTH, give);
  if (failed.size > 0) showFailure(what, failureText(failed, uavs.length));
}
