// The first visit: where no scenario was named, the page begins with the choice.

import { useSimulation } from "./simulation.ts";
import { openWindow, useWindows } from "./windows.ts";

/** What a link says that its sender wants to be seen. */
const WANTED = ["scenario", "view", "camera", "uav"];

/** Open the scenarios once, unless the part of the address behind # says what to show. */
export function welcome(hash: string): void {
  if (saysWhatToShow(hash)) return;
  const end = useSimulation.subscribe(({ server }) => {
    if (server === null || server.token_needed) return;
    end();
    if (
      server.unasked === true &&
      server.role === "operator" &&
      useWindows.getState().open === null
    )
      openWindow("scenarios");
  });
}

function saysWhatToShow(hash: string): boolean {
  const said = new URLSearchParams(hash.slice(1));
  return WANTED.some((key) => said.has(key));
}
