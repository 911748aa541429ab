import uPlot from "uplot";
import { curveOf, equalScales, extentOf, type Points, type Range } from "../../lib/curve.ts";
import { widened } from "../../lib/plotRange.ts";
import type { Series } from "../../lib/series.ts";
import { axisOf, fixed, MIN_PX, uprightAxis, type Look } from "./axes.ts";
import type { Surface } from "./useDrawing.ts";

export interface XYLine {
  colour: string;
  x: Series;
  y: Series;
}

export interface XYAxes {
  /** What stands beside each axis. */
  xLabel: string;
  yLabel: string;
  /** Minimum spans; NaN: by the values. */
  xMinSpan: number;
  yMinSpan: number;
  /** Whether both have the same scale. */
  equal: boolean;
}

const LINE_PX = 1.5;
const HEAD_PX = 4;
/** Points that are nearer to the last one than this are not drawn, px. */
const MIN_STEP_PX = 0.7;
/** Share of an axis that stays free at either end. */
const MARGIN = 0.06;
const NO_VALUES: Range = [0, 1];

/** Curves of numbers over numbers on a canvas; a dot marks the newest point of each. */
export class XYDrawing implements Surface {
  private readonly plot: uPlot;
  private curves: Points[] = [];
  /** Ranges that were zoomed to; null: all that is drawn. */
  private zoomed: [Range, Range] | null = null;

  constructor(
    container: HTMLElement,
    private readonly lines: readonly XYLine[],
    private readonly axes: XYAxes,
    look: Look,
  ) {
    const { width, height } = container.getBoundingClientRect();
    const scale: uPlot.Scale = {
      time: false,
      auto: false,
      range: (_plot, from, to) => [from, to],
    };
    const labelled = { labelSize: 18, labelFont: "12px system-ui, sans-serif" };
    this.plot = new uPlot(
      {
        width: Math.max(MIN_PX, width),
        height: Math.max(MIN_PX, height),
        legend: { show: false },
        scales: { x: scale, y: scale },
        axes: [
          {
            ...axisOf(look),
            ...labelled,
            label: axes.xLabel,
            size: 26,
            values: (_plot, marks, _axis, _space, step) => marks.map((mark) => fixed(mark, step)),
          },
          { ...uprightAxis(look), ...labelled, label: axes.yLabel },
        ],
        cursor: {
          drag: { x: true, y: true, uni: 10, setScale: false },
          points: { show: false },
        },
        hooks: { setSelect: [(plot) => this.zoom(plot)], draw: [(plot) => this.paint(plot)] },
        series: [{}, { show: false }],
      },
      [[], []],
      container,
    );
    container.addEventListener("dblclick", this.showNewest);
  }

  readonly showNewest = () => {
    this.zoomed = null;
  };

  resize(width: number, height: number): void {
    this.plot.setSize({ width: Math.max(MIN_PX, width), height: Math.max(MIN_PX, height) });
  }

  draw(from: number, to: number): void {
    this.curves = this.lines.map(({ x, y }) => curveOf(x, y, from, to));
    const [across, up] = this.fitted(this.zoomed ?? this.ranges());
    this.plot.batch(() => {
      this.plot.setData([across, [null, null]], false);
      this.plot.setScale("x", { min: across[0], max: across[1] });
      this.plot.setScale("y", { min: up[0], max: up[1] });
    });
  }

  destroy(): void {
    this.plot.destroy();
  }

  /** All that is drawn. */
  private ranges(): [Range, Range] {
    return [
      around(extentOf(this.curves.map(({ x }) => x)), this.axes.xMinSpan),
      around(extentOf(this.curves.map(({ y }) => y)), this.axes.yMinSpan),
    ];
  }

  /** Ranges with the same scale, where that is wanted. */
  private fitted(ranges: [Range, Range]): [Range, Range] {
    const { width, height } = this.plot.bbox;
    const fits = this.axes.equal && width > 0 && height > 0;
    return fits ? equalScales(...ranges, width, height) : ranges;
  }

  private paint(plot: uPlot): void {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.lineWidth = LINE_PX * devicePixelRatio;
    ctx.lineJoin = "round";
    this.curves.forEach((points, i) => {
      ctx.strokeStyle = ctx.fillStyle = this.lines[i]!.colour;
      stroke(plot, points);
    });
    ctx.restore();
  }

  private zoom(plot: uPlot): void {
    const { left, top, width, height } = plot.select;
    if (width < 4 || height < 4) return;
    this.zoomed = [
      [plot.posToVal(left, "x"), plot.posToVal(left + width, "x")],
      [plot.posToVal(top + height, "y"), plot.posToVal(top, "y")],
    ];
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  }
}

/** The curve, and a dot at its end. */
function stroke(plot: uPlot, { x, y }: Points): void {
  const { ctx } = plot;
  const minStep = MIN_STEP_PX * devicePixelRatio;
  let [lastX, lastY] = [NaN, NaN];
  ctx.beginPath();
  for (let i = 0; i < x.length; i++) {
    const px = plot.valToPos(x[i]!, "x", true);
    const py = plot.valToPos(y[i]!, "y", true);
    if (Math.abs(px - lastX) < minStep && Math.abs(py - lastY) < minStep) continue;
    if (Number.isNaN(lastX)) ctx.moveTo(px, py);
    else if (!Number.isNaN(px)) ctx.lineTo(px, py);
    [lastX, lastY] = [px, py];
  }
  ctx.stroke();
  if (x.length === 0) return;
  ctx.beginPath();
  ctx.arc(
    plot.valToPos(x.at(-1)!, "x", true),
    plot.valToPos(y.at(-1)!, "y", true),
    HEAD_PX * devicePixelRatio,
    0,
    2 * Math.PI,
  );
  ctx.fill();
}

/** Around values, at least `minSpan` wide and with a margin; from 0 to 1 without values. */
function around(extent: Range | null, minSpan: number): Range {
  if (extent === null) return NO_VALUES;
  const [min, max] = widened(...extent, minSpan);
  const margin = MARGIN * (max - min || 1);
  return [min - margin, max + margin];
}
