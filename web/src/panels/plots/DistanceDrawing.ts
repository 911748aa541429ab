import uPlot from "uplot";
import {
  histogramOf,
  nearestDistances,
  pairDistances,
  type Histogram,
} from "../../lib/distances.ts";
import { quantile } from "../../lib/quantile.ts";
import { link } from "../../link/link.ts";
import { POSE } from "../../link/protocol.ts";
import type { DistancePlot } from "../../state/plots.ts";
import { baseFrame, useVehicles } from "../../state/vehicles.ts";
import { axisOf, fixed, MIN_PX, uprightAxis, type Look } from "./axes.ts";
import { colourOf } from "./colours.ts";
import type { Surface } from "./useDrawing.ts";

/** A large fleet has half a million pairs. */
const COUNT_MS = 500;

/** What is drawn; null: fewer than two UAVs. */
export interface Distribution {
  histogram: Histogram;
  minM: number;
  medianM: number;
}

/** The distribution of the distances between UAVs at the present moment, as bars. */
export class DistanceDrawing implements Surface {
  private readonly plot: uPlot;
  private countedS = NaN;
  private countedMs = -Infinity;

  constructor(
    container: HTMLElement,
    private readonly of: DistancePlot["of"],
    look: Look,
    private readonly drawn: (distribution: Distribution | null) => void,
  ) {
    const { width, height } = container.getBoundingClientRect();
    const labelled = { labelSize: 18, labelFont: "12px system-ui, sans-serif" };
    this.plot = new uPlot(
      {
        width: Math.max(MIN_PX, width),
        height: Math.max(MIN_PX, height),
        legend: { show: false },
        scales: {
          x: { time: false, auto: false, range: (_plot, from, to) => [from, to] },
          y: { range: (_plot, _min, max) => [0, max > 0 ? 1.1 * max : 1] },
        },
        axes: [
          {
            ...axisOf(look),
            ...labelled,
            label: of === "nearest" ? "distance to the nearest UAV, m" : "distance, m",
            size: 26,
            values: (_plot, marks, _axis, _space, step) => marks.map((mark) => fixed(mark, step)),
          },
          { ...uprightAxis(look), ...labelled, label: of === "nearest" ? "UAVs, %" : "pairs, %" },
        ],
        cursor: { drag: { x: false, y: false }, points: { show: false } },
        series: [
          {},
          {
            label: "share",
            fill: colourOf(0),
            points: { show: false },
            paths: uPlot.paths.bars!({ size: [0.9, Infinity], align: 1 }),
          },
        ],
      },
      [[], []],
      container,
    );
  }

  showNewest(): void {
    this.countedS = NaN;
  }

  resize(width: number, height: number): void {
    this.plot.setSize({ width: Math.max(MIN_PX, width), height: Math.max(MIN_PX, height) });
  }

  /** Count what is at `to`, s; a moment that was counted stays. */
  draw(_from: number, to: number): void {
    const now = performance.now();
    if (to === this.countedS || now - this.countedMs < COUNT_MS) return;
    this.countedS = to;
    this.countedMs = now;
    const positions = uavPositions();
    const distances =
      this.of === "nearest" ? nearestDistances(positions) : pairDistances(positions);
    const histogram = histogramOf(distances);
    const { width, shares } = histogram;
    this.plot.batch(() => {
      this.plot.setData([shares.map((_, i) => i * width), shares], false);
      this.plot.setScale("x", { min: 0, max: shares.length * width });
    });
    const [minM, medianM] = [quantile(distances, 0), quantile(distances, 0.5)];
    this.drawn(distances.length === 0 ? null : { histogram, minM, medianM });
  }

  destroy(): void {
    this.plot.destroy();
  }
}

/** x y z of each UAV in turn, map, m. */
function uavPositions(): number[] {
  const { now } = link.frames;
  const positions: number[] = [];
  for (const { name } of useVehicles.getState().list) {
    const at = link.frames.row(baseFrame(name)) * POSE;
    if (at >= 0 && Number.isFinite(now[at])) positions.push(now[at]!, now[at + 1]!, now[at + 2]!);
  }
  return positions;
}
