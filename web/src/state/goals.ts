// Goals of UAVs: flight commands that need more than one call.

import { goTo, publishGoal, type Position } from "../link/commands/flight.ts";
import { create } from "zustand";
import { link } from "../link/link.ts";
import { eulerOf } from "../lib/pose.ts";
import { useConnection } from "./connection.ts";
import { useEpoch } from "./epoch.ts";
import { attempt, succeeds } from "./notices.ts";
import { useRestart } from "./restarts.ts";
import { pickPosition } from "./tool.ts";
import { baseFrame } from "./vehicles.ts";
import { heightAt } from "./worldPlan.ts";

/** Places that UAVs were last sent to from this page. */
export const useGoals = create<Record<string, Position>>(() => ({}));

/** Forget the goals of a flight that is over, and of a UAV that is put back to its start. */
export function followGoals(): void {
  useEpoch.subscribe(() => useGoals.setState({}, true));
  useRestart.subscribe(({ uav }) => {
    const { [uav]: _over, ...others } = useGoals.getState();
    useGoals.setState(others, true);
  });
}

/** No UAV is sent nearer to the ground than this. */
const LEAST_HEIGHT_M = 1.5;

/** Fly there, as the UAV looks now; a robot without the service gets a goal of its navigation. */
export async function sendTo(uav: string, place: Position): Promise<void> {
  useGoals.setState({ [uav]: place });
  if (useConnection.getState().volery) {
    await succeeds(`${uav}: go to`, goTo(uav, place, null));
    return;
  }
  const pose = link.frames.pose(baseFrame(uav));
  const yaw = pose === null ? 0 : eulerOf(pose[3], pose[4], pose[5], pose[6]).yaw;
  publishGoal(uav, place, yaw);
}

/** Fly to above a place of the ground at the present height, or higher where the ground is. */
export async function sendAbove(uav: string, ground: { x: number; y: number }): Promise<void> {
  const present = link.frames.pose(baseFrame(uav))?.[2] ?? 0;
  const z = Math.max(present, heightAt(ground.x, ground.y) + LEAST_HEIGHT_M);
  await sendTo(uav, { ...ground, z });
}

/** Let the user click on where a UAV is to fly. */
export async function goByClick(uav: string): Promise<void> {
  if (uav === "") return;
  const place = await attempt("Go to", pickPosition(`Goal of ${uav}`));
  if (place !== null) await sendAbove(uav, place);
}
