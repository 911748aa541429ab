import { expect, it } from "vitest";
import { shifted } from "./formation.ts";

it("a group keeps its shape around the goal; one UAV goes to the goal itself", () => {
  const group = new Map([
    ["uav1", { x: 0, y: 0 }],
    ["uav2", { x: 4, y: 0 }],
    ["uav3", { x: 2, y: 6 }],
  ]);
  expect([...shifted(group, { x: 12, y: -3 })]).toEqual([
    ["uav1", { x: 10, y: -5 }],
    ["uav2", { x: 14, y: -5 }],
    ["uav3", { x: 12, y: 1 }],
  ]);
  const one = shifted(new Map([["uav1", { x: 7, y: 8 }]]), { x: 1, y: 2 });
  expect(one.get("uav1")).toEqual({ x: 1, y: 2 });
});
