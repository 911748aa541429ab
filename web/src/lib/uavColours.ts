// What the colour of a UAV may stand for.

import { roundAbove } from "./roundAbove.ts";
import { labelColour, turbo, type Colour } from "./colourMaps.ts";

export const COLOURINGS = ["uav", "type", "speed", "battery", "height"] as const;
/** `uav`: each has its own one. */
export type Colouring = (typeof COLOURINGS)[number];

/** What colours are made from. */
export interface Coloured {
  type: string;
  airframe: string;
  /** Fraction of full; NaN: it has none. */
  battery: number;
  /** Map, m. */
  position: { z: number };
  /** Map, m/s. */
  velocity: { x: number; y: number; z: number };
}

/** A UAV without the number that colours stand for. */
export const NO_VALUE: Colour = [134, 142, 150];

/** Type of a UAV; of one without types its airframe. */
export function typeOf({ type, airframe }: Coloured): string {
  return type === "" ? airframe : type;
}

/** The number that a colour stands for, as a fraction of `top`. */
function shareOf(uav: Coloured, by: Colouring, top: number): number {
  if (by === "battery") return 1 - uav.battery; // red is empty
  return valueOf(uav, by) / top;
}

function valueOf({ position, velocity }: Coloured, by: Colouring): number {
  if (by === "height") return position.z;
  return by === "speed" ? Math.hypot(velocity.x, velocity.y, velocity.z) : NaN;
}

/** Colour of a UAV, sRGB; `types`: all types in the order of their colours. */
export function uavColour(
  uav: Coloured,
  by: Exclude<Colouring, "uav">,
  top: number,
  types: readonly string[],
): Colour {
  if (by === "type") return labelColour(1 + types.indexOf(typeOf(uav)));
  const share = shareOf(uav, by, top);
  return Number.isNaN(share) ? NO_VALUE : turbo(share);
}

/** Types of all UAVs, in the order in which they appear first. */
export function typesOf(uavs: readonly Coloured[]): string[] {
  return [...new Set(uavs.map(typeOf))];
}

/** The end of a scale that all values fit in: a round number, and no less than `minTop`. */
export function topOf(uavs: readonly Coloured[], by: Colouring, minTop: number): number {
  let top = minTop;
  for (const uav of uavs) {
    const value = valueOf(uav, by);
    if (value > top) top = value;
  }
  return roundAbove(top);
}
