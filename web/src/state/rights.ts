import { useConnection } from "./connection.ts";
import { usePlayer } from "./player.ts";
import { useSimulation } from "./simulation.ts";

/** Why nothing can be commanded now; null: it can. */
export function useWhyNot(): string | null {
  const state = useConnection((connection) => connection.state);
  const role = useSimulation(({ server }) => server?.role);
  const replaying = useSimulation(({ status }) => status?.replaying ?? false);
  const playback = usePlayer(({ player }) => player !== null);
  return whyNot(state === "open", role, replaying, playback);
}

/** Why no other scenario or recording can be opened now; null: it can. */
export function useWhyNotOpen(): string | null {
  const state = useConnection((connection) => connection.state);
  const role = useSimulation(({ server }) => server?.role);
  return whyNot(state === "open", role, false, false);
}

export function whyNotNow(): string | null {
  const { server, status } = useSimulation.getState();
  const open = useConnection.getState().state === "open";
  const playback = usePlayer.getState().player !== null;
  return whyNot(open, server?.role, status?.replaying ?? false, playback);
}

function whyNot(
  open: boolean,
  role: string | undefined,
  replaying: boolean,
  playback: boolean,
): string | null {
  if (!open) return "Not connected";
  if (role === "viewer") return "View-only access: commands require an operator token";
  if (replaying) return "A command replay is running";
  if (playback) return "A recording is playing: close it to send commands";
  return null;
}
