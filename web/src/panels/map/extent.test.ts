import { expect, it } from "vitest";
import type { Point } from "../../lib/mapProjection.ts";
import type { WorldPlan } from "../../state/worldPlan.ts";
import { extentOf } from "./extent.ts";

const UAVS: Point[] = [
  [0, 0],
  [8, -3],
];
const BARE: WorldPlan = {
  ground: { x: -500, y: -500, cell: 10, columns: 100, rows: 100, z: new Float32Array(10_000) },
  trees: [],
  roofs: new Float32Array(),
};
const tree = (x: number, y: number) => ({ x, y, crown: 2, trunk: 0.2 });

it("bare ground does not make dots of the UAVs", () => {
  expect(extentOf(BARE, UAVS)).toEqual(UAVS);
  expect(extentOf(null, UAVS)).toEqual(UAVS);
});

it("what stands is in the view", () => {
  const trees = [tree(30, 5), tree(-10, 40)];
  const roofs = new Float32Array([50, -20, 4, 52, -20, 4, 52, -22, 4]);
  expect(extentOf({ ...BARE, trees, roofs }, UAVS)).toEqual([...UAVS, [-10, -22], [52, 40]]);
});

it("a vast world is left to zooming out", () => {
  expect(extentOf({ ...BARE, trees: [tree(0, 0), tree(2500, 0)] }, UAVS)).toEqual(UAVS);
});
