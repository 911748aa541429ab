import { AT_REST, wishOfSticks, type Wish } from "../../lib/twist.ts";

/** What the first gamepad with two sticks asks for. Browsers show one once a button was pressed. */
export function wishOfGamepad(): Wish {
  const pad = connected();
  if (pad === undefined) return AT_REST;
  const [a, b, c, d] = pad.axes;
  return wishOfSticks([a ?? 0, b ?? 0], [c ?? 0, d ?? 0]);
}

export function connected(): Gamepad | undefined {
  if (!document.hasFocus()) return undefined;
  return navigator.getGamepads().find((pad) => pad !== null && pad.axes.length >= 4) ?? undefined;
}
