// Flight keys. They come before all other shortcuts, so that no view takes them in flight.

import { isFlightKey, wishOfKeys, type Wish } from "../../lib/twist.ts";
import { releaseControls, rest } from "../../state/flying.ts";
import { isTyped } from "../useHotkeys.ts";

const FAST = 2;

export interface KeySource {
  wish: () => Wish;
  /** 1, or more while the key for it is held. */
  haste: () => number;
  close: () => void;
}

/** Listen until closed. Leaving the window releases all keys, and the UAV rests. */
export function listenToKeys(): KeySource {
  const pressed = new Set<string>();
  let fast = false;
  const down = (event: KeyboardEvent) => {
    fast = event.shiftKey;
    if (event.ctrlKey || event.metaKey || event.altKey || isTyped(event)) return;
    // Whatever else it closes: a tooltip under the pointer would keep it from the page's other keys.
    if (event.code === "Escape") releaseControls();
    if (!isFlightKey(event.code)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    pressed.add(event.code);
  };
  const up = (event: KeyboardEvent) => {
    fast = event.shiftKey;
    if (pressed.delete(event.code)) event.stopImmediatePropagation();
  };
  const leave = () => {
    pressed.clear();
    fast = false;
    rest();
  };
  const hide = () => {
    if (document.hidden) leave();
  };
  window.addEventListener("keydown", down, true);
  window.addEventListener("keyup", up, true);
  window.addEventListener("blur", leave);
  document.addEventListener("visibilitychange", hide);
  return {
    wish: () => wishOfKeys(pressed),
    haste: () => (fast ? FAST : 1),
    close: () => {
      window.removeEventListener("keydown", down, true);
      window.removeEventListener("keyup", up, true);
      window.removeEventListener("blur", leave);
      document.removeEventListener("visibilitychange", hide);
    },
  };
}
