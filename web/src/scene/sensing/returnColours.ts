import { turbo } from "../../lib/colourMaps.ts";

export type Bytes = readonly [number, number, number];

/** The level scanner blue, the nodding one red, as in ROSUnitySim. */
export const LEVEL: Bytes = [20, 70, 255];
export const NODDING: Bytes = [255, 24, 14];

/** From blue at the ground to red at this height, m. */
export const HIGHEST_M = 20;

/** How the returns of a topic are coloured. */
export type ReturnColouring = "level" | "nodding" | "height";

export function colouringOf(topic: string): ReturnColouring {
  if (/nod|tilt/i.test(topic)) return "nodding";
  return /horizontal|level|scan/i.test(topic) ? "level" : "height";
}

export function heightColour(above: number): Bytes {
  return turbo(Math.min(1, Math.max(0, above / HIGHEST_M)));
}
