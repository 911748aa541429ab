// What the map shows at first.

import type { Point } from "../../lib/mapProjection.ts";
import type { WorldPlan } from "../../state/worldPlan.ts";

/** A wider world would make dots of the UAVs, m. */
const VAST_M = 2000;

/** Points that are in the view: the UAVs, and what stands; bare ground is no reason to look far. */
export function extentOf(plan: WorldPlan | null, uavs: readonly Point[]): Point[] {
  if (plan === null) return [...uavs];
  let [left, right, bottom, top] = [Infinity, -Infinity, Infinity, -Infinity];
  const include = (x: number, y: number) => {
    left = Math.min(left, x);
    right = Math.max(right, x);
    bottom = Math.min(bottom, y);
    top = Math.max(top, y);
  };
  for (const { x, y } of plan.trees) include(x, y);
  for (let i = 0; i < plan.roofs.length; i += 3) include(plan.roofs[i]!, plan.roofs[i + 1]!);
  if (left > right || right - left > VAST_M) return [...uavs];
  return [...uavs, [left, bottom], [right, top]];
}
