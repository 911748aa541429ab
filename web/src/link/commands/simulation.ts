// Time: play, pause, steps, speed, reset, and states to return to.

import { secondsOf } from "../../lib/time.ts";
import { ask, order } from "./requests.ts";

/** `simulation_interfaces/msg/SimulationState`. */
export const STOPPED = 0;
export const PLAYING = 1;
export const PAUSED = 2;

/** Steps are made by the simulation's own thread, and may take a while. */
const STEP_TIMEOUT_S = 120;
const RESTORE_TIMEOUT_S = 60;

export async function setPlaying(playing: boolean): Promise<void> {
  await ask("/set_simulation_state", "simulation_interfaces/srv/SetSimulationState", {
    state: { state: playing ? PLAYING : PAUSED },
  });
}

/** Fly on past the scenario's end. */
export async function continueRun(): Promise<void> {
  await order("/volery/continue_run", "std_srvs/srv/Trigger", {});
}

/** Physics steps of a paused simulation; done when they are made. */
export async function step(steps: number): Promise<void> {
  const type = "simulation_interfaces/srv/StepSimulation";
  await ask("/step_simulation", type, { steps }, STEP_TIMEOUT_S);
}

/** Factor of real time; 0: as fast as possible. */
export async function setSpeed(factor: number): Promise<void> {
  await order("/volery/set_speed", "volery_interfaces/srv/SetSpeed", { factor });
}

/** Back to the start; what was spawned goes. */
export async function reset(): Promise<void> {
  const type = "simulation_interfaces/srv/ResetSimulation";
  await ask("/reset_simulation", type, { scope: 0 }, RESTORE_TIMEOUT_S);
}

export interface Snapshot {
  name: string;
  /** Simulated time that it returns to, s. */
  timeS: number;
}

export async function listSnapshots(): Promise<Snapshot[]> {
  const type = "volery_interfaces/srv/ListSnapshots";
  const { names, stamps } = await order("/volery/list_snapshots", type, {});
  return names.map((name, i) => ({ name, timeS: secondsOf(stamps[i]!) }));
}

export async function saveSnapshot(name: string): Promise<void> {
  await order("/volery/save_snapshot", "volery_interfaces/srv/ByName", { name }, RESTORE_TIMEOUT_S);
}

export async function restoreSnapshot(name: string): Promise<void> {
  await order(
    "/volery/restore_snapshot",
    "volery_interfaces/srv/ByName",
    { name },
    RESTORE_TIMEOUT_S,
  );
}

export async function deleteSnapshot(name: string): Promise<void> {
  await order("/volery/delete_snapshot", "volery_interfaces/srv/ByName", { name });
}
