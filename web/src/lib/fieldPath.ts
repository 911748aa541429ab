// Fields of messages by name: `pose.pose.position.z`, `ranges[3]`. Texts that hold JSON, as those of
// status topics do, are objects here: `data.cost`.

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
    value = parsed(value);
    if (value === null || typeof value !== "object") return undefined;
    value = (value as Record<Step, unknown>)[step];
  }
  return value;
}

/** The object that a text holds as JSON; else the value itself. */
export function parsed(value: unknown): unknown {
  if (typeof value !== "string" || !/^\s*[{[]/.test(value)) return value;
  try {
    return JSON.parse(value) as unknown;
  } catch {
    return value;
  }
}

/** Paths of all numbers in a value; the first element stands for an array. */
export function pathsIn(value: unknown, path = ""): string[] {
  const inner = parsed(value);
  if (!Number.isNaN(numberOf(inner))) return [path];
  if (inner === null || typeof inner !== "object") return [];
  if (Array.isArray(inner)) return inner.length > 0 ? pathsIn(inner[0], join(path, 0)) : [];
  return Object.entries(inner)
    .filter(([name]) => !/[.[\]]/.test(name)) // no path leads there
    .flatMap(([name, own]) => pathsIn(own, join(path, name)));
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
