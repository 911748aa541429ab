import { create } from "zustand";
import { activeFaultsOf, type ActiveFault } from "../lib/activeFaults.ts";
import { link } from "../link/link.ts";

export const useFaults = create<{ active: ActiveFault[] }>(() => ({ active: [] }));

/** Keep the list of active faults up to date. */
export function followFaults(): void {
  link.subscribe("/volery/faults", "std_msgs/msg/String", ({ message }) =>
    useFaults.setState({ active: activeFaultsOf((message as { data: string }).data) }),
  );
  link.watch(() => {
    if (link.state === "open") useFaults.setState({ active: [] }); // it may be another world
  });
}
