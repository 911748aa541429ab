import { useEffect } from "react";
import { nextMark } from "../lib/speed.ts";
import {
  PLAYING,
  setPlaying,
  setSpeed,
  step,
  sendCommand,
  type FlightCommand,
} from "../link/commands.ts";
import { commandAll, commandText } from "../state/commanding.ts";
import { toggleControls } from "../state/flying.ts";
import { toggleOverlay } from "../state/layout.ts";
import { attempt, showFailure } from "../state/notices.ts";
import { goByClick } from "../state/goals.ts";
import { whyNotNow } from "../state/rights.ts";
import { useSimulation } from "../state/simulation.ts";
import { givePosition, setMoving, useTool } from "../state/tool.ts";
import { allSelected, select, useVehicles } from "../state/vehicles.ts";
import { openWindow, useWindows } from "../state/windows.ts";

/** Keys that change the simulation; others only the page. */
const COMMANDS: Readonly<Record<string, () => void>> = {
  " ": () => command("Play, pause", setPlaying(useSimulation.getState().status?.state !== PLAYING)),
  ".": () => command("Step", step(1)),
  "+": () => changeSpeed(true),
  "-": () => changeSpeed(false),
  t: () => order("take_off"),
  h: () => order("hold"),
  l: () => order("land"),
  b: () => order("return_home"),
  g: () => void goByClick(allSelected()),
  c: toggleControls,
  v: () => setMoving(!useTool.getState().moving),
};

const PAGE: Readonly<Record<string, () => void>> = {
  "[": () => selectNext(-1),
  "]": () => selectNext(1),
  m: () => toggleOverlay("map"),
  p: () => toggleOverlay("pictures"),
  "?": () => openWindow("help"),
  Escape: () => {
    const { selected, group } = useVehicles.getState();
    if (useTool.getState().asking !== null) givePosition(null);
    else if (useTool.getState().moving) setMoving(false);
    else if (group.length > 0) select(selected);
  },
};

/** The page's keys; flight keys are in `manual/keys.ts`, those of views in `views/`. */
export function useHotkeys(): void {
  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      if (event.ctrlKey || event.metaKey || event.altKey || isTyped(event)) return;
      if (useWindows.getState().open !== null) return;
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      const run = PAGE[key] ?? COMMANDS[key];
      if (run === undefined || (event.repeat && key !== ".")) return;
      // A space on a button presses it.
      if (key === " " && event.target instanceof HTMLButtonElement) return;
      event.preventDefault();
      const whyNot = key in COMMANDS ? whyNotNow() : null;
      if (whyNot === null) run();
      else showFailure("Command unavailable", whyNot);
    };
    // Not at the window: a tooltip that Escape closes lets no event pass beyond the document.
    document.addEventListener("keydown", press);
    return () => document.removeEventListener("keydown", press);
  }, []);
}

/** Whether a key belongs to what has the focus: text, a slider, a list. */
export function isTyped({ target }: KeyboardEvent): boolean {
  if (!(target instanceof HTMLElement)) return false;
  return (
    target.closest("input, textarea, select, [role=slider], [role=menu], [contenteditable]") !==
    null
  );
}

function command(what: string, asked: Promise<unknown>): void {
  void attempt(what, asked);
}

function order(what: FlightCommand): void {
  const uavs = allSelected();
  if (uavs.length > 0) void commandAll(commandText(what), uavs, (uav) => sendCommand(uav, what));
}

function changeSpeed(up: boolean): void {
  const wanted = useSimulation.getState().status?.speed ?? 1;
  command("Speed", setSpeed(nextMark(wanted, up)));
}

function selectNext(by: number): void {
  const { list, selected } = useVehicles.getState();
  const at = list.findIndex(({ name }) => name === selected);
  const next = list[(at + by + list.length) % Math.max(1, list.length)];
  if (next !== undefined) select(next.name);
}
