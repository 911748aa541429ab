// What happened and what was commanded: /events and /volery/log, kept from when the page opens.

import { create } from "zustand";
import { secondsOf } from "../lib/time.ts";
import { link } from "../link/link.ts";
import { showFailure } from "./notices.ts";

export type EntrySort = "event" | "problem" | "command";

export interface Entry {
  number: number;
  /** Simulated time, s. */
  timeS: number;
  sort: EntrySort;
  kind: string;
  /** UAV of an event, client of a command. */
  source: string;
  text: string;
}

interface EventJson {
  time_ns: number;
  uav: string;
  kind: string;
  position_map: [number, number, number];
  speed_m_s: number;
  partner: string;
  detail: string;
}

/** A record of `/volery/log`. */
export interface Command {
  stamp: { sec: number; nanosec: number };
  client: string;
  kind: string;
  name: string;
  content: string;
}

/** How many records wait for a slow page: many events can happen at once. */
export const COMMAND_DEPTH = 1000;
const MAX_ENTRIES = 5000;
const SHOW_MS = 200;
const PROBLEMS = new Set(["impact", "collision", "fault", "battery"]);

/** The newest entries, the oldest first; published a few times a second. */
export const useJournal = create<{ entries: Entry[] }>(() => ({ entries: [] }));

let written: Entry[] = [];
let next = 0;
let timer: ReturnType<typeof setTimeout> | null = null;

export function followJournal(): void {
  link.subscribe(
    "/events",
    "std_msgs/msg/String",
    ({ message }) => {
      const entry = entryOfEvent(message.data);
      if (entry === null) return;
      write(entry);
      const warning = warningOf(entry);
      if (warning !== null) showFailure(warning, entry.text);
    },
    { depth: COMMAND_DEPTH },
  );
  link.subscribe(
    "/volery/log",
    "volery_interfaces/msg/CommandRecord",
    ({ message }: { message: unknown }) => write(entryOfCommand(message as Command)),
    { depth: COMMAND_DEPTH },
  );
}

/** Title of the notice that an event deserves, as a falling battery does; null: none. */
export function warningOf({ kind, source, timeS }: Omit<Entry, "number">): string | null {
  return kind === "battery" ? `${source}, ${timeS.toFixed(1)} s` : null;
}

export function clearJournal(): void {
  written = [];
  useJournal.setState({ entries: [] });
}

/** An event of `/events`; null: the text is none. */
export function entryOfEvent(text: string): Omit<Entry, "number"> | null {
  let event: EventJson;
  try {
    event = JSON.parse(text) as EventJson;
  } catch {
    return null;
  }
  if (typeof event?.time_ns !== "number") return null;
  return {
    timeS: event.time_ns * 1e-9,
    sort: PROBLEMS.has(event.kind) ? "problem" : "event",
    kind: event.kind,
    source: event.uav,
    text: textOf(event),
  };
}

function textOf({
  kind,
  detail,
  partner,
  speed_m_s: speed,
  position_map: position,
}: EventJson): string {
  const where = `at (${position.map((metres) => metres.toFixed(1)).join(", ")}) m`;
  const impactSpeed = `at ${speed.toFixed(2)} m/s`;
  if (kind === "world") return detail;
  if (kind === "collision") return `hit ${partner} ${impactSpeed} ${where}`;
  if (kind === "impact") return `hit the ground ${impactSpeed} ${where}`;
  if (kind === "touch_down") return `touched down ${impactSpeed} ${where}`;
  return `${detail} ${where}`;
}

function entryOfCommand({ stamp, client, kind, name, content }: Command): Omit<Entry, "number"> {
  return {
    timeS: secondsOf(stamp),
    sort: kind === "refused" ? "problem" : "command",
    kind,
    source: client,
    text: `${name} ${content}`,
  };
}

function write(entry: Omit<Entry, "number">): void {
  written.push({ ...entry, number: next++ });
  if (written.length > 2 * MAX_ENTRIES) written = written.slice(-MAX_ENTRIES);
  timer ??= setTimeout(() => {
    timer = null;
    useJournal.setState({ entries: written.slice(-MAX_ENTRIES) });
  }, SHOW_MS);
}
