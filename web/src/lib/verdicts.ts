/** `verdict` of `/volery/verdicts`. */
export interface Verdict {
  name: string;
  kind: string;
  /** "pending": the flight may still do what is expected. */
  outcome: "passed" | "failed" | "error" | "pending";
  /** What was measured. */
  text: string;
  /** Distance from failing, negative if it failed; null: it has none. */
  margin: number | null;
  unit: string;
  /** Simulated time of the moment that decided, s; null: there is none. */
  time_s: number | null;
  /** UAV that decided; empty: none alone. */
  uav: string;
}

/** Verdicts on the expectations of a flight. */
export interface Verdicts {
  /** Whether the flight is over. */
  over: boolean;
  list: Verdict[];
}

export const NO_VERDICTS: Verdicts = { over: false, list: [] };

/** Returns the verdicts of a message; none for what is not one, such as that of a foreign log. */
export function verdictsOf(text: string): Verdicts {
  try {
    const found = JSON.parse(text) as { over?: unknown; verdicts?: unknown };
    if (!Array.isArray(found.verdicts)) return NO_VERDICTS;
    const list = found.verdicts.map(verdictOf).filter((verdict) => verdict !== null);
    return { over: found.over === true, list };
  } catch {
    return NO_VERDICTS;
  }
}

/** State of all verdicts together: the worst one decides. */
export function stateOf({ list }: Verdicts): Verdict["outcome"] {
  const outcomes = new Set(list.map(({ outcome }) => outcome));
  const order = ["failed", "error", "pending"] as const;
  return order.find((outcome) => outcomes.has(outcome)) ?? "passed";
}

/** `3 of 5 met`. */
export function summaryOf({ list }: Verdicts): string {
  const met = list.filter(({ outcome }) => outcome === "passed").length;
  return `${met} of ${list.length} met`;
}

/** `+0.42 m`; empty without a margin. */
export function marginText({ margin, unit }: Verdict): string {
  if (margin === null) return "";
  const number = Math.abs(margin) >= 100 ? margin.toFixed(0) : margin.toPrecision(3);
  return `${margin > 0 ? "+" : ""}${number}${unit === "" ? "" : ` ${unit}`}`;
}

/** Moments at which a flight failed, s, each once. */
export function failuresOf({ list }: Verdicts): number[] {
  const times = list.flatMap(({ outcome, time_s }) =>
    outcome === "failed" && time_s !== null ? [time_s] : [],
  );
  return [...new Set(times)];
}

function verdictOf(value: unknown): Verdict | null {
  if (typeof value !== "object" || value === null) return null;
  const verdict = value as Record<string, unknown>;
  const { outcome } = verdict;
  if (typeof verdict["name"] !== "string" || typeof outcome !== "string") return null;
  if (!["passed", "failed", "error", "pending"].includes(outcome)) return null;
  return {
    name: verdict["name"],
    kind: textOf(verdict["kind"]),
    outcome: outcome as Verdict["outcome"],
    text: textOf(verdict["text"]),
    margin: numberOf(verdict["margin"]),
    unit: textOf(verdict["unit"]),
    time_s: numberOf(verdict["time_s"]),
    uav: textOf(verdict["uav"]),
  };
}

function textOf(value: unknown): string {
  return typeof value === "string" ? value : "";
}

function numberOf(value: unknown): number | null {
  return typeof value === "number" && Number.isFinite(value) ? value : null;
}
