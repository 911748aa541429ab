import { create } from "zustand";
import { keep, readKept } from "../lib/kept.ts";

/** A number of a topic's messages. */
export interface Line {
  topic: string;
  type: string;
  /** As `pose.pose.position.z`. */
  path: string;
}

export interface Plot {
  id: number;
  lines: Line[];
}

interface Plots {
  plots: Plot[];
  /** What is seen of the newest, s of simulated time. */
  windowS: number;
}

const KEY = "volery.plots";

export const usePlots = create<Plots>(() =>
  readKept(KEY, { plots: [{ id: 1, lines: [] }], windowS: 20 }),
);
usePlots.subscribe((plots) => keep(KEY, plots));

export function nameOf({ topic, path }: Line): string {
  return `${topic}.${path}`;
}

/** Draw a line in a plot, or in the last one. */
export function drawLine(line: Line, plot?: number): void {
  usePlots.setState(({ plots }) => {
    const id = plot ?? plots.at(-1)?.id ?? 1;
    const known = plots.length > 0 ? plots : [{ id, lines: [] }];
    return {
      plots: known.map((one) =>
        one.id === id && !one.lines.some((other) => nameOf(other) === nameOf(line))
          ? { ...one, lines: [...one.lines, line] }
          : one,
      ),
    };
  });
}

export function removeLine(plot: number, line: Line): void {
  usePlots.setState(({ plots }) => ({
    plots: plots.map((one) =>
      one.id === plot
        ? { ...one, lines: one.lines.filter((other) => nameOf(other) !== nameOf(line)) }
        : one,
    ),
  }));
}

export function addPlot(): void {
  usePlots.setState(({ plots }) => ({
    plots: [...plots, { id: Math.max(0, ...plots.map(({ id }) => id)) + 1, lines: [] }],
  }));
}

export function removePlot(id: number): void {
  usePlots.setState(({ plots }) => ({ plots: plots.filter((one) => one.id !== id) }));
}

export function setWindow(windowS: number): void {
  usePlots.setState({ windowS });
}
