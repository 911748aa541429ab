import { useEffect, useRef } from "react";
import { useEpoch } from "../../state/epoch.ts";
import { isRestarting } from "../../state/restarts.ts";
import { useVehicles } from "../../state/vehicles.ts";

const MAX_POINTS = 600;
const MIN_STEP_M = 0.3;
/** A UAV that was put elsewhere did not fly there. */
const LONGEST_STEP_M = 50;

/** Where a UAV has been: x y in turn, the newest last. */
export class Trail {
  readonly points: number[] = [];

  add(x: number, y: number): void {
    const { points } = this;
    const step = Math.hypot(x - (points.at(-2) ?? Infinity), y - (points.at(-1) ?? Infinity));
    if (step < MIN_STEP_M) return;
    if (step > LONGEST_STEP_M) points.length = 0;
    points.push(x, y);
    if (points.length > 2 * MAX_POINTS) points.splice(0, 2);
  }
}

/** Trails of all UAVs while the map is shown. */
export function useTrails(): ReadonlyMap<string, Trail> {
  const trails = useRef(new Map<string, Trail>());
  useEffect(() => useEpoch.subscribe(() => trails.current.clear()), []);
  useEffect(
    () =>
      useVehicles.subscribe(({ list }, before) => {
        if (list === before.list) return;
        const known = trails.current;
        const present = new Set<string>();
        for (const { name, position } of list) {
          present.add(name);
          if (!known.has(name) || isRestarting(name)) known.set(name, new Trail());
          else known.get(name)!.add(position.x, position.y);
        }
        for (const name of known.keys()) {
          if (!present.has(name)) known.delete(name);
        }
      }),
    [],
  );
  return trails.current;
}
