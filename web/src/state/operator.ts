// Which operator controls a UAV.

import { create } from "zustand";
import { keep, readStored } from "../lib/storage.ts";
import { takeControl } from "../link/commands/controlAuthority.ts";
import { link } from "../link/link.ts";
import { useVehicles } from "./vehicles.ts";

interface Operator {
  /** The name that the simulation gives this page; empty: unknown until the page controls a UAV. */
  name: string;
  /** The name that the user chooses. */
  wished: string;
}

const KEY = "volery.operator";

export const useOperator = create<Operator>(() => ({
  name: "",
  ...readStored(KEY, { wished: "" }),
}));

export function setOperatorName(wished: string): void {
  useOperator.setState({ wished });
  keep(KEY, { wished });
}

/** Takes control of a UAV under the chosen name, or the one that the simulation has given already. */
export async function take(uav: string): Promise<void> {
  const { name, wished } = useOperator.getState();
  useOperator.setState({ name: await takeControl(uav, holds(name) ? "" : wished) });
}

/** Another operator that controls a UAV; empty: none. */
export function useOtherOperator(uav: string): string {
  const operator = useVehicles(({ list }) => list.find(({ name }) => name === uav)?.operator ?? "");
  const own = useOperator(({ name }) => name);
  return operator === own ? "" : operator;
}

/** A disconnection releases every UAV, and the next connection may have another name. */
export function followDisconnection(): void {
  link.watch(() => {
    if (link.state !== "open") useOperator.setState({ name: "" });
  });
}

function holds(name: string): boolean {
  return name !== "" && useVehicles.getState().list.some(({ operator }) => operator === name);
}
