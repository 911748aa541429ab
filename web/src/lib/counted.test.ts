import { expect, it } from "vitest";
import { counted } from "./counted.ts";

it("counts one and several", () => {
  expect([0, 1, 2].map((number) => counted(number, "UAV"))).toEqual(["0 UAVs", "1 UAV", "2 UAVs"]);
});
