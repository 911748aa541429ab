import { create } from "zustand";
import { keep, readStored } from "../lib/storage.ts";
import { isLength, shortOf } from "../lib/units.ts";
import type { Curve, Line } from "../lib/usualCurves.ts";

export type { Curve, Line };

/** Lines over simulated time. */
export interface TimePlot {
  id: number;
  kind?: "time";
  lines: Line[];
}

/** Curves of numbers over numbers. */
export interface XYPlot {
  id: number;
  kind: "xy";
  curves: Curve[];
  /** Whether both axes have the same scale; null: where both show lengths. */
  equal: boolean | null;
}

/** How the distances between UAVs are distributed at a moment. */
export interface DistancePlot {
  id: number;
  kind: "distances";
  /** Of each UAV to the nearest one, or of all pairs. */
  of: "nearest" | "pairs";
}

export type Plot = TimePlot | XYPlot | DistancePlot;

interface Plots {
  plots: Plot[];
  /** What is seen of the newest, s of simulated time. */
  windowS: number;
}

const KEY = "volery.plots";

export const usePlots = create<Plots>(() =>
  readStored(KEY, { plots: [{ id: 1, lines: [] }], windowS: 20 }),
);
usePlots.subscribe((plots) => keep(KEY, plots));

export function nameOf({ topic, path }: Line): string {
  return `${topic}.${path}`;
}

/** Which numbers a curve shows, x before y, for a legend: `/uav1/odom position.x, y`. */
export function curveName({ x, y }: Curve): string {
  if (x.topic !== y.topic) return `${x.topic} ${shortOf(x.path)}, ${y.topic} ${shortOf(y.path)}`;
  const [parent, last] = splitPath(y.path);
  const beside = splitPath(x.path)[0] === parent ? last : shortOf(y.path);
  return `${y.topic} ${shortOf(x.path)}, ${beside}`;
}

/** `pose.position.x` as `pose.position` and `x`. */
function splitPath(path: string): [string, string] {
  const at = path.lastIndexOf(".");
  return [path.slice(0, Math.max(0, at)), path.slice(at + 1)];
}

/** Everything that a plot shows, each number once. */
export function linesOf(plot: Plot): Line[] {
  if (plot.kind === "distances") return [];
  if (plot.kind !== "xy") return plot.lines;
  const lines = plot.curves.flatMap(({ x, y }) => [x, y]);
  return [...new Map(lines.map((line) => [nameOf(line), line])).values()];
}

/** Whether both axes of a plot have the same scale. */
export function hasEqualScales({ equal, curves }: XYPlot): boolean {
  const lengths = curves.every(({ x, y }) => isLength(x.path, x.type) && isLength(y.path, y.type));
  return equal ?? (curves.length > 0 && lengths);
}

/** Draw a line in a plot, or in the last one that is over time. */
export function drawLine(line: Line, plot?: number): void {
  if (plot === undefined && !usePlots.getState().plots.some(isOverTime)) addPlot();
  const id = plot ?? usePlots.getState().plots.findLast(isOverTime)!.id;
  change(id, (one) =>
    !isOverTime(one) || one.lines.some((other) => nameOf(other) === nameOf(line))
      ? one
      : { ...one, lines: [...one.lines, line] },
  );
}

export function removeLine(plot: number, line: Line): void {
  change(plot, (one) =>
    isOverTime(one)
      ? { ...one, lines: one.lines.filter((other) => nameOf(other) !== nameOf(line)) }
      : one,
  );
}

/** Draw curves in an x-y plot; those that it has stay as they are. */
export function drawCurves(plot: number, curves: readonly Curve[]): void {
  change(plot, (one) => {
    if (one.kind !== "xy") return one;
    const known = new Set(one.curves.map(curveKey));
    return {
      ...one,
      curves: [...one.curves, ...curves.filter((curve) => !known.has(curveKey(curve)))],
    };
  });
}

export function removeCurve(plot: number, curve: Curve): void {
  change(plot, (one) =>
    one.kind === "xy"
      ? { ...one, curves: one.curves.filter((other) => curveKey(other) !== curveKey(curve)) }
      : one,
  );
}

/** What identifies a curve. */
export function curveKey({ x, y }: Curve): string {
  return `${nameOf(x)} ${nameOf(y)}`;
}

export function setEqualScales(plot: number, equal: boolean): void {
  change(plot, (one) => (one.kind === "xy" ? { ...one, equal } : one));
}

export function setDistances(plot: number, of: DistancePlot["of"]): void {
  change(plot, (one) => (one.kind === "distances" ? { ...one, of } : one));
}

export function addDistancePlot(): void {
  addInstead((id) => ({ id, kind: "distances", of: "nearest" }));
}

export function addPlot(): void {
  add((id) => ({ id, lines: [] }));
}

/** A plot of numbers over numbers, with these curves to begin with. */
export function addXYPlot(curves: Curve[]): void {
  addInstead((id) => ({ id, kind: "xy", curves, equal: null }));
}

export function removePlot(id: number): void {
  usePlots.setState(({ plots }) => ({ plots: plots.filter((one) => one.id !== id) }));
}

export function setWindow(windowS: number): void {
  usePlots.setState({ windowS });
}

function isOverTime(plot: Plot): plot is TimePlot {
  return plot.kind === undefined || plot.kind === "time";
}

/** Add a plot, which replaces empty ones. */
function addInstead(made: (id: number) => Plot): void {
  usePlots.setState(({ plots }) => ({
    plots: plots.filter((one) => one.kind === "distances" || linesOf(one).length > 0),
  }));
  add(made);
}

function add(made: (id: number) => Plot): void {
  usePlots.setState(({ plots }) => ({
    plots: [...plots, made(Math.max(0, ...plots.map(({ id }) => id)) + 1)],
  }));
}

function change(id: number, changed: (plot: Plot) => Plot): void {
  usePlots.setState(({ plots }) => ({
    plots: plots.map((one) => (one.id === id ? changed(one) : one)),
  }));
}
