import { create } from "zustand";
import { secondsOf } from "../lib/time.ts";
import { link } from "../link/link.ts";
import type { volery_interfaces_SimulationStatus } from "../messages/generated.ts";

/** What the server says of itself over HTTP (`./api/status`). */
export interface ServerStatus {
  state: "flying" | "ended" | "building" | "no_world" | "failed";
  scenario: string;
  /** Its name in words. */
  title?: string;
  description: string;
  message: string;
  /** Changes with the geometry; null: there is none. */
  world: string | null;
  version: string;
  role: "operator" | "viewer";
  token_needed: boolean;
  /** Whether `./tensorboard/` shows trainings; other servers do not say. */
  tensorboard?: boolean;
  /** Whether the server chose the scenario that flies by itself. */
  unasked?: boolean;
}

interface SimulationState {
  /** The last status that arrived. */
  server: ServerStatus | null;
  /** Whether the server answered the last request. */
  reachable: boolean;
  status: volery_interfaces_SimulationStatus | null;
}

export const useSimulation = create<SimulationState>(() => ({
  server: null,
  reachable: false,
  status: null,
}));

const ASK_MS = 1000;

/** Keep both stores of this file up to date. */
export function followSimulation(ownServer: boolean): void {
  link.subscribe("/volery/status", "volery_interfaces/msg/SimulationStatus", ({ message }) =>
    useSimulation.setState({ status: message }),
  );
  link.watch(() => {
    // It may be another world, and a recording has no status.
    if (link.state === "open") useSimulation.setState({ status: null });
  });
  if (!ownServer) return;
  const ask = async () => {
    try {
      const answer = await fetch("./api/status", { cache: "no-store" });
      const answered = answer.ok ? { server: (await answer.json()) as ServerStatus } : {};
      useSimulation.setState({ reachable: answer.ok, ...answered });
    } catch {
      useSimulation.setState({ reachable: false });
    }
    setTimeout(() => void ask(), ASK_MS);
  };
  void ask();
}

/** Simulated time of what came last, s. */
export function simulatedS(): number {
  const { status } = useSimulation.getState();
  return Math.max(link.frames.stampS, status === null ? 0 : secondsOf(status.stamp));
}
