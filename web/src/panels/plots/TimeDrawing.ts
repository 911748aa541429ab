import uPlot from "uplot";
import { widened } from "../../lib/plotRange.ts";
import { columnsOf, type Series } from "../../lib/series.ts";
import { axisOf, MIN_PX, uprightAxis, type Look } from "./axes.ts";
import type { Surface } from "./useDrawing.ts";

export interface Drawn {
  name: string;
  colour: string;
  series: Series;
  /** Minimum span of its axis; NaN: by its values. */
  minSpan: number;
}

/** Lines over time on a canvas. However many points come, it is drawn from a few per pixel. */
export class TimeDrawing implements Surface {
  private readonly plot: uPlot;
  /** What was zoomed to, s; null: the newest. */
  zoomed: [number, number] | null = null;

  constructor(
    container: HTMLElement,
    private readonly lines: readonly Drawn[],
    look: Look,
  ) {
    const { width, height } = container.getBoundingClientRect();
    const spans = lines.map(({ minSpan }) => minSpan).filter((span) => !Number.isNaN(span));
    const minSpan = spans.length === 0 ? NaN : Math.max(...spans);
    this.plot = new uPlot(
      {
        width: Math.max(MIN_PX, width),
        height: Math.max(MIN_PX, height),
        legend: { show: false },
        scales: {
          x: { time: false, auto: false, range: (_plot, from, to) => [from, to] },
          y: { range: (_plot, min, max) => rangeOf(min, max, minSpan) },
        },
        axes: [
          {
            ...axisOf(look),
            size: 26,
            values: (_plot, marks) => marks.map((mark) => `${round(mark)} s`),
          },
          uprightAxis(look),
        ],
        cursor: { drag: { x: true, y: false, setScale: false }, points: { size: 5 } },
        hooks: { setSelect: [(plot) => this.zoom(plot)] },
        series: [
          {},
          ...lines.map(({ name, colour }) => ({
            label: name,
            stroke: colour,
            width: 1.5,
            spanGaps: true,
            points: { show: false },
          })),
        ],
      },
      [[], ...lines.map(() => [])] as unknown as uPlot.AlignedData,
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

  /** Draw what lies between two times, or what was zoomed to. */
  draw(from: number, to: number): void {
    [from, to] = this.zoomed ?? [from, to];
    const pixels = Math.max(30, Math.round(this.plot.bbox.width / devicePixelRatio));
    const columns = columnsOf(
      this.lines.map(({ series }) => series),
      from,
      to,
      pixels,
    );
    this.plot.batch(() => {
      this.plot.setData(columns as unknown as uPlot.AlignedData, false);
      this.plot.setScale("x", { min: from, max: to });
    });
  }

  destroy(): void {
    this.plot.destroy();
  }

  private zoom(plot: uPlot): void {
    const { left, width } = plot.select;
    if (width < 4) return;
    this.zoomed = [plot.posToVal(left, "x"), plot.posToVal(left + width, "x")];
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  }
}

/** As uPlot has it, around at least `minSpan`; without values from 0 to 1. */
function rangeOf(min: number | null, max: number | null, minSpan: number): uPlot.Range.MinMax {
  if (min === null || max === null) return [0, 1];
  return uPlot.rangeNum(...widened(min, max, minSpan), 0.1, true);
}

function round(time: number): string {
  return String(Math.round(time * 1000) / 1000);
}
