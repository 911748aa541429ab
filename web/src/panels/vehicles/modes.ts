import { ownEntry } from "../../lib/ownEntry.ts";

const COLOURS: Readonly<Record<string, string>> = {
  LANDED: "gray",
  TAKE_OFF: "blue",
  HOLD: "teal",
  GO_TO: "cyan",
  VELOCITY: "cyan",
  TRAJECTORY: "cyan",
  LOW_LEVEL: "violet",
  LAND: "blue",
  RETURN: "indigo",
  CRASHED: "red",
};

/** Colour of a flight mode. */
export function colourOf(mode: string): string {
  return ownEntry(COLOURS, mode) ?? "gray";
}

/** `TAKE_OFF` as `take off`. */
export function modeText(mode: string): string {
  return mode.toLowerCase().replaceAll("_", " ");
}

export function batteryColour(share: number): string {
  return share < 0.15 ? "red" : share < 0.35 ? "orange" : "teal";
}
