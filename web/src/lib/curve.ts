import { LONGEST_STEP_S } from "./continuity.ts";
import type { Series } from "./series.ts";

/** Points in order; NaN in both: the curve is interrupted there. */
export interface Points {
  x: number[];
  y: number[];
}

/**
 * One series over another one between two times, s: a point for each of `y`, with the value that `x`
 * has at that time, between its two nearest points. A gap in time, as a moved playback leaves it,
 * interrupts the curve.
 */
export function curveOf(x: Series, y: Series, from: number, to: number): Points {
  const points: Points = { x: [], y: [] };
  let lastS = NaN;
  let at = 0;
  for (let i = y.indexOf(from); i < y.length; i++) {
    const time = y.xAt(i);
    if (time > to) break;
    if (at === 0) at = x.indexOf(time);
    while (at < x.length && x.xAt(at) < time) at++;
    const across = valueAt(x, at, time);
    const up = y.yAt(i);
    if (!Number.isFinite(across) || !Number.isFinite(up)) continue;
    if (time - lastS > LONGEST_STEP_S) interrupt(points);
    points.x.push(across);
    points.y.push(up);
    lastS = time;
  }
  return points;
}

/** Value at `time`, where point `at` is the first one that is not earlier; NaN: not known. */
function valueAt(line: Series, at: number, time: number): number {
  if (at >= line.length) return NaN;
  const next = line.xAt(at);
  if (next === time) return line.yAt(at);
  if (at === 0) return NaN;
  const before = line.xAt(at - 1);
  if (next - before > LONGEST_STEP_S) return NaN;
  const share = (time - before) / (next - before);
  return line.yAt(at - 1) + share * (line.yAt(at) - line.yAt(at - 1));
}

function interrupt({ x, y }: Points): void {
  x.push(NaN);
  y.push(NaN);
}

export type Range = [number, number];

/** Minimum and maximum of many lists, NaN left out; null: there is none. */
export function extentOf(lists: readonly (readonly number[])[]): Range | null {
  let [min, max] = [Infinity, -Infinity];
  for (const list of lists)
    for (const value of list) {
      if (value < min) min = value;
      if (value > max) max = value;
    }
  return min > max ? null : [min, max];
}

/** Both ranges with as many units a pixel: the one that has fewer grows around its middle. */
export function equalScales(x: Range, y: Range, width: number, height: number): [Range, Range] {
  const perPixel = Math.max((x[1] - x[0]) / width, (y[1] - y[0]) / height);
  return [grown(x, perPixel * width), grown(y, perPixel * height)];
}

function grown([min, max]: Range, span: number): Range {
  const missing = Math.max(0, span - (max - min)) / 2;
  return [min - missing, max + missing];
}
