import { expect, it } from "vitest";
import { counted } from "./counted.ts";

it("tells of one thing and of several", () => {
  expect([0, 1, 2].map((number) => counted(number, "UAV"))).toEqual(["0 UAVs", "1 UAV", "2 UAVs"]);
});
