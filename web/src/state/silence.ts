import { create } from "zustand";
import { nowMs } from "../lib/time.ts";
import { link } from "../link/link.ts";

/** For how long nothing has come over a link that stands, s; 0: it is not silent. */
export const useSilence = create(() => ({ seconds: 0 }));

const LOOK_MS = 500;
/** A simulation tells its status five times a second, even while paused. */
const SILENT_AFTER_MS = 2000;

export function followSilence(): void {
  let openSinceMs = nowMs();
  link.watch(() => (openSinceMs = nowMs()));
  setInterval(() => {
    const quietMs = nowMs() - Math.max(openSinceMs, link.heardMs);
    const seconds =
      link.state === "open" && quietMs > SILENT_AFTER_MS ? Math.floor(quietMs / 1000) : 0;
    if (seconds !== useSilence.getState().seconds) useSilence.setState({ seconds });
  }, LOOK_MS);
}
