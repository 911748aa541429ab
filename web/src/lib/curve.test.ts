import { describe, expect, it } from "vitest";
import { curveOf, equalScales, extentOf } from "./curve.ts";
import { Series } from "./series.ts";

function lineOf(points: [number, number][]): Series {
  const line = new Series();
  for (const [time, value] of points) line.push(time, value);
  return line;
}

describe("a curve of one series over another", () => {
  it("has the values of equal times, within a span of time", () => {
    const x = lineOf([[0, 10], [1, 11], [2, 12], [3, 13]]); // prettier-ignore
    const y = lineOf([[0, 0], [1, 5], [2, 7], [3, 9]]); // prettier-ignore
    expect(curveOf(x, y, 1, 2)).toEqual({ x: [11, 12], y: [5, 7] });
  });

  it("is drawn where topics come at different times: x is taken between its neighbours", () => {
    const x = lineOf([[0, 0], [1, 10], [2, 20]]); // prettier-ignore
    const y = lineOf([[-0.5, 1], [0.5, 2], [1.25, 3], [2.1, 4]]); // prettier-ignore
    expect(curveOf(x, y, -1, 3)).toEqual({ x: [5, 12.5], y: [2, 3] }); // no x yet, no x any more
  });

  it("is interrupted where time has a gap, and skips what is no number", () => {
    const x = lineOf([[0, 0], [1, 1], [2, 2], [60, 3], [61, 4]]); // prettier-ignore
    const y = lineOf([[0, 0], [1, NaN], [2, 2], [60, 3], [61, 4]]); // prettier-ignore
    expect(curveOf(x, y, 0, 99)).toEqual({ x: [0, 2, NaN, 3, 4], y: [0, 2, NaN, 3, 4] });
  });

  it("forgets what is later when time goes back, as a reset does", () => {
    const [x, y] = [lineOf([[5, 1], [6, 2]]), lineOf([[5, 1], [6, 2]])]; // prettier-ignore
    x.push(0, 7);
    y.push(0, 8);
    expect(curveOf(x, y, -99, 99)).toEqual({ x: [7], y: [8] });
  });
});

describe("ranges", () => {
  it("hold all values that are numbers", () => {
    expect(extentOf([[3, NaN, 1], [7]])).toEqual([1, 7]);
    expect(extentOf([[], [NaN]])).toBeNull();
  });

  it("give both axes the same scale, and lose nothing", () => {
    const [x, y] = equalScales([0, 10], [0, 1], 400, 200);
    expect(x).toEqual([0, 10]);
    expect(y).toEqual([-2, 3]); // 10 m on 400 px: 5 m on 200 px, around the middle
    const [wide, high] = equalScales([0, 1], [0, 10], 400, 200);
    expect((wide[1] - wide[0]) / 400).toBeCloseTo((high[1] - high[0]) / 200);
    expect(high).toEqual([0, 10]);
  });
});
