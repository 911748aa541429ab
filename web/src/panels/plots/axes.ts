// What the drawings of all plots have in common: how their axes look.

import type uPlot from "uplot";

export interface Look {
  text: string;
  grid: string;
}

/** Minimum size of a drawing, px. */
export const MIN_PX = 60;
const DIGIT_PX = 7.5;

export function axisOf(look: Look): uPlot.Axis {
  return {
    stroke: look.text,
    grid: { stroke: look.grid, width: 1 },
    ticks: { show: false },
  };
}

/** An upright axis: wide enough for its longest mark. */
export function uprightAxis(look: Look): uPlot.Axis {
  return {
    ...axisOf(look),
    size: (_plot, marks) => widthOf(marks),
    values: (_plot, marks, _axis, _space, step) => marks.map((mark) => fixed(mark, step)),
  };
}

/** A mark with the digits that distinguish it from the next one. */
export function fixed(mark: number, step: number): string {
  return mark.toFixed(Math.min(12, Math.max(0, -Math.floor(Math.log10(step)))));
}

function widthOf(marks: readonly string[] | null): number {
  return 20 + DIGIT_PX * Math.max(4, ...(marks ?? []).map((mark) => mark.length));
}
