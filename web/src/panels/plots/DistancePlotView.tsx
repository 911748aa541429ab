import { SegmentedControl } from "@mantine/core";
import { useCallback, useState } from "react";
import { histogramCsv } from "../../lib/distances.ts";
import { setDistances, type DistancePlot } from "../../state/plots.ts";
import type { Look } from "./axes.ts";
import { colourOf } from "./colours.ts";
import { DistanceDrawing, type Distribution } from "./DistanceDrawing.ts";
import { PlotFrame } from "./PlotFrame.tsx";
import { useDrawing } from "./useDrawing.ts";

const CHOICES = [
  { value: "nearest", label: "To the nearest UAV" },
  { value: "pairs", label: "All pairs" },
];

/** How the distances between UAVs are distributed now. */
export function DistancePlotView({ plot, paused }: { plot: DistancePlot; paused: boolean }) {
  const { id, of } = plot;
  const [shown, setShown] = useState<Distribution | null>(null);
  const make = useCallback(
    (element: HTMLElement, look: Look) => new DistanceDrawing(element, of, look, setShown),
    [of],
  );
  const value = shown && `min ${shown.minM.toFixed(2)} m, median ${shown.medianM.toFixed(2)} m`;
  return (
    <PlotFrame
      plot={plot}
      drawn={useDrawing(make, paused)}
      hint="Distances need two UAVs."
      legend={value === null ? [] : [{ name: "distances", colour: colourOf(0), value }]}
      csv={() => (shown === null ? "" : histogramCsv(shown.histogram))}
    >
      <SegmentedControl
        size="xs"
        aria-label="Distances"
        data={CHOICES}
        value={of}
        onChange={(chosen) => setDistances(id, chosen as DistancePlot["of"])}
      />
    </PlotFrame>
  );
}
