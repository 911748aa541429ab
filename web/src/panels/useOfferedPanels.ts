import { useMemo } from "react";
import { useSimulation } from "../state/simulation.ts";
import { PANELS, type PanelEntry } from "./registry.ts";
import { offeredPanels } from "./tensorboard/tensorboard.ts";

/** The panels that the page's server offers. */
export function useOfferedPanels(): PanelEntry[] {
  const offered = useSimulation(({ server }) => server?.tensorboard === true);
  return useMemo(() => offeredPanels(PANELS, { tensorboard: offered }), [offered]);
}
