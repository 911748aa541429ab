import { expect, it } from "vitest";
import { NameCells } from "./nameCells.ts";

it("names keep their cells, and new ones take those that were not asked for the longest", () => {
  const cells = new NameCells(3);
  expect(cells.hold(["a", "b"])).toEqual([
    ["a", 0],
    ["b", 1],
  ]);
  expect(cells.hold(["b", "c"])).toEqual([["c", 2]]);
  expect(cells.hold(["a"])).toEqual([]);
  expect(cells.hold(["d", "a"])).toEqual([["d", 1]]);
  expect(["a", "b", "c", "d"].map((name) => cells.cellOf(name))).toEqual([0, -1, 2, 1]);
});
