/** What a policy observes, and what it does, as its node publishes it. */

/** A part of the observation, from the policy's description. */
export interface Part {
  name: string;
  size: number;
  history: number;
  unit: string;
  scale: number;
}

export interface Description {
  task: string;
  airframe: string;
  parts: Part[];
  action: string;
  choices: number | null;
  rateHz: number;
}

/** One number as a bar. */
export interface Bar {
  label: string;
  /** As the network takes it; most lie between -1 and 1. */
  value: number;
  /** In the part's unit. */
  text: string;
}

export interface BarGroup {
  name: string;
  bars: Bar[];
  /** Numbers that are not shown: those of large parts, such as images. */
  hidden: number;
}

export interface Sample {
  timeMs: number;
  value: number;
}

const MAX_BARS = 40;
const KEPT_MS = 30_000;
const AXES = ["x", "y", "z"];
const CHOICES = ["hover", "forward", "back", "left", "right", "up", "down"];

/** The description of the topic `policy/description`; null: it is none. */
export function descriptionOf(text: string): Description | null {
  let data: unknown;
  try {
    data = JSON.parse(text);
  } catch {
    return null;
  }
  if (!isRecord(data) || !Array.isArray(data["observation"]) || !isRecord(data["action"])) {
    return null;
  }
  const action = data["action"];
  return {
    task: textOf(data["task"]),
    airframe: textOf(data["airframe"]),
    parts: data["observation"].filter(isRecord).map((part) => ({
      name: textOf(part["name"]),
      size: numberOf(part["size"], 0),
      history: numberOf(part["history"], 1),
      unit: textOf(part["unit"]),
      scale: numberOf(part["scale"], 1),
    })),
    action: textOf(action["kind"]),
    choices: typeof action["choices"] === "number" ? action["choices"] : null,
    rateHz: numberOf(data["decision_rate_hz"], NaN),
  };
}

/** State and reason of the topic `policy/status`; null: it is none. */
export function statusOf(text: string): { state: string; reason: string; policy: string } | null {
  try {
    const data: unknown = JSON.parse(text);
    if (!isRecord(data)) return null;
    const { state, reason, policy } = data;
    return { state: textOf(state), reason: textOf(reason), policy: textOf(policy) };
  } catch {
    return null;
  }
}

/** The numbers of an observation by part; empty where they do not fit the description. */
export function observationBars(parts: readonly Part[], numbers: ArrayLike<number>): BarGroup[] {
  const total = parts.reduce((sum, part) => sum + part.size * part.history, 0);
  if (numbers.length !== total) return [];
  const groups: BarGroup[] = [];
  let first = 0;
  for (const part of parts) {
    const count = part.size * part.history;
    const shown = Math.min(count, MAX_BARS);
    const bars = Array.from({ length: shown }, (_, k) => {
      const value = numbers[first + k] ?? NaN;
      return { label: labelOf(part, k), value, text: quantity(value * part.scale, part.unit) };
    });
    groups.push({ name: part.name, bars, hidden: count - shown });
    first += count;
  }
  return groups;
}

/** The numbers of an action, or the choice by its name. */
export function actionBars(
  description: Pick<Description, "action" | "choices">,
  numbers: ArrayLike<number>,
): BarGroup {
  const { action, choices } = description;
  const bars = Array.from(numbers, (value, k) => {
    if (choices === null) return { label: `${k + 1}`, value, text: value.toFixed(2) };
    const named = action === "discrete_velocity" ? CHOICES[value] : undefined;
    return { label: "choice", value: value / (choices - 1), text: named ?? `${value}` };
  });
  return { name: action, bars, hidden: 0 };
}

/** The samples of the last half minute, with a new one. */
export function withSample(samples: readonly Sample[], sample: Sample): Sample[] {
  return [...samples, sample].filter(({ timeMs }) => sample.timeMs - timeMs <= KEPT_MS);
}

/** Points of a polyline of samples in a box of this size, the newest at its right edge. */
export function polyline(samples: readonly Sample[], width: number, height: number): string {
  const newest = samples.at(-1);
  if (newest === undefined) return "";
  const values = samples.map(({ value }) => value);
  const low = Math.min(...values);
  const range = Math.max(...values) - low || 1;
  return samples
    .map(({ timeMs, value }) => {
      const x = width * (1 - (newest.timeMs - timeMs) / KEPT_MS);
      const y = height * (1 - (value - low) / range);
      return `${x.toFixed(1)},${y.toFixed(1)}`;
    })
    .join(" ");
}

/** Left edge and width, in percent, of a bar that begins in the middle. */
export function extentOf(value: number): { left: number; width: number } {
  const clipped = Math.max(-1, Math.min(1, Number.isFinite(value) ? value : 0));
  return { left: 50 + 50 * Math.min(0, clipped), width: 50 * Math.abs(clipped) };
}

function labelOf(part: Part, index: number): string {
  const within = index % part.size;
  const name = part.size === 3 ? (AXES[within] ?? "") : `${within + 1}`;
  const age = part.history - 1 - Math.floor(index / part.size);
  return part.history === 1 || age === 0 ? name : `${name} -${age}`;
}

function quantity(value: number, unit: string): string {
  return unit === "1" || unit === "" ? value.toFixed(2) : `${value.toFixed(2)} ${unit}`;
}

function isRecord(data: unknown): data is Record<string, unknown> {
  return typeof data === "object" && data !== null && !Array.isArray(data);
}

function textOf(data: unknown): string {
  return typeof data === "string" ? data : "";
}

function numberOf(data: unknown, otherwise: number): number {
  return typeof data === "number" ? data : otherwise;
}
