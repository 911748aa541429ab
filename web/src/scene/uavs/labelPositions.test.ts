import { expect, it } from "vitest";
import { chooseLabels, type Box } from "./labelPositions.ts";

function box(id: number, left: number, rank: number): Box {
  return { id, left, top: 0, width: 40, height: 16, rank };
}

it("names never overlap, and the higher rank wins", () => {
  expect(chooseLabels([box(1, 0, -5), box(2, 20, -1), box(3, 70, -9)])).toEqual([2, 3]);
  expect(chooseLabels([box(1, 0, 1e6), box(2, 20, -1), box(3, 30, 0)])).toEqual([1]);
  expect(chooseLabels(Array.from({ length: 300 }, (_, i) => box(i, 50 * i, -i))).length).toBe(48);
});
