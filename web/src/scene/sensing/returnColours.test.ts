import { expect, it } from "vitest";
import { colouringOf } from "./returnColours.ts";

it("returns are coloured by how their LIDAR moves, others by their height", () => {
  expect(colouringOf("/uav1/laser/horizontal/points")).toBe("level");
  expect(colouringOf("/uav1/laser/nodding/points")).toBe("nodding");
  expect(colouringOf("/tilt_scan")).toBe("nodding");
  expect(colouringOf("/uav1/points")).toBe("height");
});
