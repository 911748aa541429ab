import { create } from "zustand";
import type { Place } from "../link/commands/flight.ts";

/** What a click in the scene or on the map means now, besides looking around. */
interface Tool {
  /** What a place is being asked for, as shown to the user; null: for nothing. */
  asking: string | null;
  /** Whether the selected UAV has handles to drag it by. */
  moving: boolean;
}

export const useTool = create<Tool>(() => ({ asking: null, moving: false }));

let answer: ((place: Place | null) => void) | null = null;

/** Let the user click on a place of the ground; null: he thought better of it. */
export function pickPlace(what: string): Promise<Place | null> {
  givePlace(null);
  return new Promise((resolve) => {
    answer = resolve;
    useTool.setState({ asking: what });
  });
}

/** A place that was clicked; null ends the question. */
export function givePlace(place: Place | null): void {
  const waiting = answer;
  answer = null;
  useTool.setState({ asking: null });
  waiting?.(place);
}

export function setMoving(moving: boolean): void {
  useTool.setState({ moving });
}
