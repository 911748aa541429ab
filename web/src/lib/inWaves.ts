// One request to each of many.

import { counted } from "./counted.ts";

/**
 * Ask each of many, `width` at a time and in order; one that fails does not keep the others.
 * Returns the reason of each failure, by name.
 */
export async function inWaves(
  names: readonly string[],
  width: number,
  ask: (name: string) => Promise<unknown>,
): Promise<Map<string, string>> {
  const failed = new Map<string, string>();
  let next = 0;
  const work = async () => {
    while (next < names.length) {
      const name = names[next++]!;
      try {
        await ask(name);
      } catch (error) {
        failed.set(name, error instanceof Error ? error.message : String(error));
      }
    }
  };
  await Promise.all(Array.from({ length: Math.min(width, names.length) }, work));
  return failed;
}

/** Why some of many failed: `3 of 40 UAVs (uav2, uav7, uav9): reason`. */
export function failureText(failed: ReadonlyMap<string, string>, count: number): string {
  const names = [...failed.keys()];
  const some = names.slice(0, 3).join(", ") + (names.length > 3 ? ", …" : "");
  const reasons = [...new Set(failed.values())];
  const more = reasons.length > 1 ? ` (and ${counted(reasons.length - 1, "other reason")})` : "";
  return `${names.length} of ${count} UAVs (${some}): ${reasons[0]}${more}`;
}
