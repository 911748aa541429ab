// What the page asks of a simulation, each as one function. Failures reject with the reason.

import { link } from "./link.ts";

const PLAYING = 1;
const PAUSED = 2;
const RESULT_OK = 1;

export class RefusedError extends Error {}

export async function setPlaying(playing: boolean): Promise<void> {
  const { result } = await link.call(
    "/set_simulation_state",
    "simulation_interfaces/srv/SetSimulationState",
    { state: { state: playing ? PLAYING : PAUSED } },
  );
  if (result.result !== RESULT_OK) throw new RefusedError(result.error_message);
}
