import { useConnection } from "./connection.ts";
import { useSimulation } from "./simulation.ts";

/** Why nothing can be commanded now; null: it can. */
export function useWhyNot(): string | null {
  const state = useConnection((connection) => connection.state);
  const role = useSimulation(({ server }) => server?.role);
  const replaying = useSimulation(({ status }) => status?.replaying ?? false);
  return whyNot(state === "open", role, replaying);
}

export function whyNotNow(): string | null {
  const { server, status } = useSimulation.getState();
  const open = useConnection.getState().state === "open";
  return whyNot(open, server?.role, status?.replaying ?? false);
}

function whyNot(open: boolean, role: string | undefined, replaying: boolean): string | null {
  if (!open) return "There is no connection";
  if (role === "viewer") return "You are looking on: the pilots' token is needed to steer";
  if (replaying) return "A recorded flight is repeated";
  return null;
}
