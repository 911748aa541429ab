// Manual control: which UAV, how fast, and the 20 Hz at which velocities are published.

import { create } from "zustand";
import { fly, stopFlying } from "../link/commands/flight.ts";
import { keep, readStored } from "../lib/storage.ts";
import { AT_REST, isAtRest, sum, twistOf, type Speeds, type Wish } from "../lib/twist.ts";
import { useVehicles } from "./vehicles.ts";

interface Flying {
  /** UAV whose controls are taken; empty: none. */
  uav: string;
  /** What keys, sticks and gamepad ask for together. */
  wish: Wish;
  speeds: Speeds;
}

const PERIOD_MS = 50;
const KEY = "volery.speeds";
const USUAL: Speeds = { level: 3, climb: 1.5, turn: 1.2 };

export const useFlying = create<Flying>(() => ({
  uav: "",
  wish: AT_REST,
  speeds: readStored(KEY, USUAL),
}));

let haste = () => 1;

/** What multiplies the speeds, such as a key that is held; returns how to end that. */
export function setHaste(asked: () => number): () => void {
  haste = asked;
  return () => {
    haste = () => 1;
  };
}

/** What asks for a velocity; each is asked 20 times a second while the controls are taken. */
const sources = new Set<() => Partial<Wish>>();
let timer: ReturnType<typeof setInterval> | undefined;
let moving = false;

export function addSource(source: () => Partial<Wish>): () => void {
  sources.add(source);
  return () => sources.delete(source);
}

export function takeControls(uav: string): void {
  releaseControls();
  if (uav === "") return;
  useFlying.setState({ uav });
  timer = setInterval(tick, PERIOD_MS);
}

/** Ends manual control; a UAV that moved comes to rest. */
export function releaseControls(): void {
  rest();
  clearInterval(timer);
  useFlying.setState({ uav: "", wish: AT_REST });
}

export function toggleControls(): void {
  if (useFlying.getState().uav === "") takeControls(useVehicles.getState().selected);
  else releaseControls();
}

export function setSpeeds(speeds: Partial<Speeds>): void {
  useFlying.setState((flying) => ({ speeds: { ...flying.speeds, ...speeds } }));
  keep(KEY, useFlying.getState().speeds);
}

/** Come to rest at once, as when the window loses its focus. */
export function rest(): void {
  const { uav } = useFlying.getState();
  if (uav !== "" && moving) stopFlying(uav);
  moving = false;
}

function tick(): void {
  const { uav, wish: before, speeds } = useFlying.getState();
  const wish = sum([...sources].map((source) => source()));
  if (!same(wish, before)) useFlying.setState({ wish });
  if (isAtRest(wish)) return rest();
  moving = true;
  const by = haste();
  fly(uav, twistOf(wish, { ...speeds, level: speeds.level * by, climb: speeds.climb * by }));
}

function same(a: Wish, b: Wish): boolean {
  return a.ahead === b.ahead && a.left === b.left && a.up === b.up && a.turn === b.turn;
}

// Controls belong to one UAV: selecting another one does not move them to it.
useVehicles.subscribe(({ selected }) => {
  const { uav } = useFlying.getState();
  if (uav !== "" && uav !== selected) releaseControls();
});
