import { create } from "zustand";
import type { Position } from "../link/commands/flight.ts";

/** What a click in the scene or on the map means now, besides looking around. */
interface Tool {
  /** What a position is requested for, as shown to the user; null: for nothing. */
  asking: string | null;
  /** Whether the selected UAV has handles to drag it by. */
  moving: boolean;
}

export const useTool = create<Tool>(() => ({ asking: null, moving: false }));

let answer: ((position: Position | null) => void) | null = null;

/** Lets the user click a position on the ground; null: the user cancels. */
export function pickPosition(what: string): Promise<Position | null> {
  givePosition(null);
  return new Promise((resolve) => {
    answer = resolve;
    useTool.setState({ asking: what });
  });
}

/** Ends the request with a clicked position; null cancels it. */
export function givePosition(position: Position | null): void {
  const waiting = answer;
  answer = null;
  useTool.setState({ asking: null });
  waiting?.(position);
}

export function setMoving(moving: boolean): void {
  useTool.setState({ moving });
}
