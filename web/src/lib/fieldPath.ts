// Fields of messages by name: `pose.pose.position.z`, `ranges[3]`.

type Step = string | number;

/** Steps of a path; `ranges[3].x` has three. */
export function stepsOf(path: string): Step[] {
  const steps: Step[] = [];
  for (const [, name, index] of path.matchAll(/([^.[\]]+)|\[(\d+)\]/g)) {
    steps.push(index === undefined ? name! : Number(index));
  }
  return steps;
}

/** What stands at the end of `steps`; undefined: nothing. */
export function valueAt(message: unknown, steps: readonly Step[]): unknown {
  let value = message;
  for (const step of steps) {
    if (value === null || typeof value !== "object") return undefined;
    value = (value as Record<Step, unknown>)[step];
  }
  return value;
}

/** A number of what can be drawn as one: numbers, long integers, truth; else NaN. */
export function numberOf(value: unknown): number {
  if (typeof value === "number") return value;
  if (typeof value === "bigint" || typeof value === "boolean") return Number(value);
  return NaN;
}

/** One step further: `position` of `pose`, element 3 of `ranges`. */
export function join(path: string, step: Step): string {
  if (typeof step === "number") return `${path}[${step}]`;
  return path === "" ? step : `${path}.${step}`;
}
