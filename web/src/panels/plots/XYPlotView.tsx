import { ActionIcon } from "@mantine/core";
import { Scaling } from "lucide-react";
import { useCallback, useMemo } from "react";
import { minSpanOf } from "../../lib/plotRange.ts";
import { axisText } from "../../lib/units.ts";
import {
  curveName,
  hasEqualScales,
  linesOf,
  nameOf,
  removeCurve,
  setEqualScales,
  type Line,
  type XYPlot,
} from "../../state/plots.ts";
import { AddCurve } from "./AddCurve.tsx";
import type { Look } from "./axes.ts";
import { colourOf } from "./colours.ts";
import { PlotFrame } from "./PlotFrame.tsx";
import { seriesOf } from "./recorder.ts";
import { useDrawing } from "./useDrawing.ts";
import { numberText, useNewest } from "./useNewest.ts";
import { XYDrawing } from "./XYDrawing.ts";

/** Curves of numbers over numbers: where UAVs flew, seen from above. */
export function XYPlotView({ plot, paused }: { plot: XYPlot; paused: boolean }) {
  const { id, curves } = plot;
  const equal = hasEqualScales(plot);
  const make = useCallback(
    (element: HTMLElement, look: Look) => {
      const [across, up] = [curves.map(({ x }) => x), curves.map(({ y }) => y)];
      const axes = {
        xLabel: axisText(across),
        yLabel: axisText(up),
        xMinSpan: minSpan(across),
        yMinSpan: minSpan(up),
        equal,
      };
      const lines = curves.map(({ x, y }, i) => ({
        colour: colourOf(i),
        x: seriesOf(x),
        y: seriesOf(y),
      }));
      return new XYDrawing(element, lines, axes, look);
    },
    [curves, equal],
  );
  const newest = useNewest(useMemo(() => linesOf(plot), [plot]));
  const valueOf = (line: Line) => numberText(newest.get(nameOf(line)));
  return (
    <PlotFrame
      plot={plot}
      drawn={useDrawing(make, paused)}
      hint="Add a curve: one field against another."
      legend={curves.map((curve, i) => ({
        name: curveName(curve),
        title: `x: ${nameOf(curve.x)}, y: ${nameOf(curve.y)}`,
        colour: colourOf(i),
        value: valueOf(curve.x) && `${valueOf(curve.x)}, ${valueOf(curve.y)}`,
        remove: () => removeCurve(id, curve),
      }))}
      actions={
        <>
          <AddCurve plot={id} />
          <ActionIcon
            size="sm"
            variant={equal ? "light" : "subtle"}
            aria-label="Same scale on both axes"
            aria-pressed={equal}
            title="Same scale on both axes"
            onClick={() => setEqualScales(id, !equal)}
          >
            <Scaling size={14} />
          </ActionIcon>
        </>
      }
    />
  );
}

function minSpan(lines: readonly Line[]): number {
  const spans = lines.map(({ path }) => minSpanOf(path)).filter((span) => !Number.isNaN(span));
  return spans.length === 0 ? NaN : Math.max(...spans);
}
