import { useCallback } from "react";
import { minSpanOf } from "../../lib/plotRange.ts";
import { nameOf, removeLine, type TimePlot } from "../../state/plots.ts";
import { AddLine } from "./AddLine.tsx";
import type { Look } from "./axes.ts";
import { colourOf } from "./colours.ts";
import { PlotFrame } from "./PlotFrame.tsx";
import { seriesOf } from "./recorder.ts";
import { TimeDrawing } from "./TimeDrawing.ts";
import { useDrawing } from "./useDrawing.ts";
import { numberText, useNewest } from "./useNewest.ts";

/** Lines over simulated time. */
export function TimePlotView({ plot, paused }: { plot: TimePlot; paused: boolean }) {
  const { lines } = plot;
  const make = useCallback(
    (element: HTMLElement, look: Look) =>
      new TimeDrawing(
        element,
        lines.map((line, i) => ({
          name: nameOf(line),
          colour: colourOf(i),
          series: seriesOf(line),
          minSpan: minSpanOf(line.path),
        })),
        look,
      ),
    [lines],
  );
  const newest = useNewest(lines);
  return (
    <PlotFrame
      plot={plot}
      drawn={useDrawing(make, paused)}
      hint="Choose a topic and a field below to add a line."
      legend={lines.map((line, i) => ({
        name: nameOf(line),
        colour: colourOf(i),
        value: numberText(newest.get(nameOf(line))),
        remove: () => removeLine(plot.id, line),
      }))}
    >
      <AddLine plot={plot.id} />
    </PlotFrame>
  );
}
