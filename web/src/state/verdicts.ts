import { create } from "zustand";
import { NO_VERDICTS, verdictsOf, type Verdicts } from "../lib/verdicts.ts";
import { link } from "../link/link.ts";
import { useConnection } from "./connection.ts";

/** Verdicts on the expectations of the flight or log that is shown; none without expectations. */
export const useVerdicts = create<Verdicts>(() => NO_VERDICTS);

/** Keep the verdicts up to date. */
export function followVerdicts(): void {
  link.subscribe("/volery/verdicts", "std_msgs/msg/String", ({ message }) =>
    useVerdicts.setState(verdictsOf((message as { data: string }).data)),
  );
  // With a new connection it may be another flight, of which nothing is expected.
  useConnection.subscribe(({ state }, before) => {
    if (state === "open" && before.state !== "open") useVerdicts.setState(NO_VERDICTS);
  });
}
