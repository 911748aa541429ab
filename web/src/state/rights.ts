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
  if (!open) return "There is no connection";
  if (role === "viewer") return "You are looking on: the pilots' token is needed to steer";
  if (replaying) return "A recorded flight is repeated";
  if (playback) return "A recording is played: close it to fly";
  return null;
}
