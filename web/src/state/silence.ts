import { create } from "zustand";
import { nowMs } from "../lib/time.ts";
import { link } from "../link/link.ts";

/** Since when nothing has come over a link that stands, as `nowMs()`; 0: it is not silent. */
export const useSilence = create(() => ({ sinceMs: 0 }));

const LOOK_MS = 100;
/** A simulation publishes its status five times a second, even while paused. */
const SILENT_AFTER_MS = 1000;

export function followSilence(): void {
  let openSinceMs = nowMs();
  link.watch(() => (openSinceMs = nowMs()));
  setInterval(() => {
    const receivedMs = Math.max(openSinceMs, link.receivedMs);
    const silent = link.state === "open" && nowMs() - receivedMs > SILENT_AFTER_MS;
    const sinceMs = silent ? receivedMs : 0;
    if (sinceMs !== useSilence.getState().sinceMs) useSilence.setState({ sinceMs });
  }, LOOK_MS);
}
