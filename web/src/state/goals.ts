// Goals of UAVs: flight commands that need more than one call.

import { goTo, publishGoal, type Position } from "../link/commands/flight.ts";
import { create } from "zustand";
import { link } from "../link/link.ts";
import { counted } from "../lib/counted.ts";
import { shifted } from "../lib/formation.ts";
import { eulerOf } from "../lib/pose.ts";
import { useConnection } from "./connection.ts";
import { useEpoch } from "./epoch.ts";
import { commandAll } from "./commanding.ts";
import { attempt } from "./notices.ts";
import { useRestart } from "./restarts.ts";
import { pickPosition } from "./tool.ts";
import { baseFrame } from "./vehicles.ts";
import { heightAt } from "./worldPlan.ts";

/** Positions that UAVs were last sent to from this page. */
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
const MIN_HEIGHT_M = 1.5;

/** Fly there, as the UAV looks now; a robot without the service gets a goal of its navigation. */
export async function sendTo(uav: string, position: Position): Promise<void> {
  useGoals.setState({ [uav]: position });
  if (useConnection.getState().volery) {
    await goTo(uav, position, null);
    return;
  }
  const pose = link.frames.pose(baseFrame(uav));
  const yaw = pose === null ? 0 : eulerOf(pose[3], pose[4], pose[5], pose[6]).yaw;
  publishGoal(uav, position, yaw);
}

/** Fly UAVs to above a position on the ground; several keep their formation. */
export async function sendAllAbove(
  uavs: readonly string[],
  ground: { x: number; y: number },
): Promise<void> {
  const goals = shifted(new Map(uavs.map((uav) => [uav, positionOf(uav)])), ground);
  await commandAll("go to", uavs, (uav) => sendAbove(uav, goals.get(uav)!));
}

/** Fly to above a position on the ground at the present height, or higher where the ground is. */
async function sendAbove(uav: string, ground: { x: number; y: number }): Promise<void> {
  const z = Math.max(positionOf(uav).z, heightAt(ground.x, ground.y) + MIN_HEIGHT_M);
  await sendTo(uav, { ...ground, z });
}

/** Let the user click on where UAVs are to fly; several keep their formation. */
export async function goByClick(uavs: readonly string[]): Promise<void> {
  if (uavs.length === 0) return;
  const what = uavs.length === 1 ? uavs[0]! : counted(uavs.length, "UAV");
  const position = await attempt("Go to", pickPosition(`Goal of ${what}`));
  if (position !== null) await sendAllAbove(uavs, position);
}

function positionOf(uav: string): Position {
  const [x, y, z] = link.frames.pose(baseFrame(uav)) ?? [0, 0, 0];
  return { x, y, z };
}
