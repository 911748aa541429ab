import { create } from "zustand";
import { topOf, typesOf, type Colouring } from "../lib/uavColours.ts";
import { useVehicles } from "./vehicles.ts";

/** What the colours of UAVs in the scene and on the map stand for. */
interface UavColouring {
  by: Colouring;
  /** End of the scale of speed, m/s, or height, m. It grows with the values and does not shrink. */
  top: number;
  /** Types of the fleet, in the order of their colours. */
  types: readonly string[];
}

const MIN_TOP = 1;

export const useColouring = create<UavColouring>(() => ({ by: "uav", top: MIN_TOP, types: [] }));

export function colourBy(by: Colouring): void {
  useColouring.setState({ by, top: MIN_TOP, types: [] });
  fit();
}

/** Fit the scale to the fleet as it is now. */
function fit(): void {
  const { list } = useVehicles.getState();
  const { by, top: before, types: known } = useColouring.getState();
  if (by === "uav") return;
  const top = topOf(list, by, before);
  const types = by === "type" ? typesOf(list) : known;
  if (top !== before || types.join("\n") !== known.join("\n"))
    useColouring.setState({ top, types });
}

useVehicles.subscribe(({ list }, before) => {
  if (list !== before.list) fit();
});
