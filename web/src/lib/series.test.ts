import { describe, expect, it } from "vitest";
import { columnsOf, csvOf, Series } from "./series.ts";

function lineOf(points: [number, number][], capacity?: number): Series {
  const line = new Series(capacity);
  for (const [x, y] of points) line.push(x, y);
  return line;
}

describe("a series", () => {
  it("keeps the newest points in order", () => {
    const line = lineOf([], 4);
    for (let i = 0; i < 11; i++) line.push(i, 10 * i);
    expect(line.length).toBe(4);
    expect([0, 1, 2, 3].map((i) => line.xAt(i))).toEqual([7, 8, 9, 10]);
    expect(line.yAt(3)).toBe(100);
    expect(line.lastX).toBe(10);
    expect(line.indexOf(8.5)).toBe(2);
    expect(line.indexOf(99)).toBe(4);
  });

  it("forgets what is later when time goes back", () => {
    const line = lineOf([[1, 1], [2, 2], [3, 3], [1.5, 9]]); // prettier-ignore
    expect(line.length).toBe(2);
    expect([line.xAt(1), line.yAt(1)]).toEqual([1.5, 9]);
  });

  it("loses no peak however many points fall on a pixel", () => {
    const line = new Series(50_000);
    for (let i = 0; i < 50_000; i++) line.push(i / 1000, i === 31_234 ? 77 : Math.sin(i));
    const [x, y] = columnsOf([line], 0, 50, 100);
    expect(x.length).toBe(200);
    expect(Math.max(...y!.map((value) => value ?? 0))).toBe(77);
    expect(y!.indexOf(77)).toBe(2 * Math.floor(31.234 / 0.5) + 1);
    expect(Math.min(...y!.map((value) => value ?? 0))).toBeCloseTo(-1, 4);
  });

  it("leaves columns without a point empty, and skips what is no number", () => {
    const [, y] = columnsOf([lineOf([[1, 5], [2, NaN], [3, 7]])], 0, 4, 4); // prettier-ignore
    expect(y).toEqual([null, null, 5, 5, null, null, 7, 7]);
  });

  it("is written beside others, a row for each time", () => {
    const height = lineOf([[0.5, 1], [1, 2]]); // prettier-ignore
    const other = lineOf([[1, -3]]);
    const [head, ...rows] = csvOf(["/odom.z", 'odd, "name"'], [height, other]).trim().split("\n");
    expect(head).toBe('time_s,/odom.z,"odd, ""name"""');
    expect(rows.map((row) => row.split(",").map((cell) => (cell === "" ? null : +cell)))).toEqual([
      [0.5, 1, null],
      [1, 2, -3],
    ]);
  });
});
