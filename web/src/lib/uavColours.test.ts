import { expect, it } from "vitest";
import { turbo } from "./colourMaps.ts";
import { NO_VALUE, topOf, typesOf, uavColour } from "./uavColours.ts";

const at = { x: 0, y: 0, z: 0 };
const uav = { type: "", airframe: "f450", battery: NaN, position: at, velocity: at };

it("a scale ends at 1, 2 or 5 times a power of ten above all values, and does not shrink", () => {
  const fast = [uav, { ...uav, velocity: { x: 3, y: 4, z: 0.1 } }];
  expect(topOf(fast, "speed", 1)).toBe(10);
  expect(topOf(fast, "speed", 20)).toBe(20);
  expect(topOf([uav], "speed", 1)).toBe(1);
  expect(topOf([{ ...uav, position: { z: 180 } }, uav], "height", 1)).toBe(200);
  expect(topOf([{ ...uav, position: { z: 0.3 } }], "height", 5)).toBe(5);
});

it("colours go from blue to red with the value, and an empty battery is red", () => {
  expect(uavColour({ ...uav, position: { z: 10 } }, "height", 20, [])).toEqual(turbo(0.5));
  expect(uavColour({ ...uav, velocity: { x: 0, y: 4, z: 3 } }, "speed", 5, [])).toEqual(turbo(1));
  expect(uavColour({ ...uav, battery: 0.25 }, "battery", 1, [])).toEqual(turbo(0.75));
  expect(uavColour(uav, "battery", 1, [])).toEqual(NO_VALUE);
});

it("each type has a colour; a UAV without a type has its airframe's", () => {
  const mixed = [uav, { ...uav, type: "scout" }, uav, { ...uav, type: "relay" }];
  const types = typesOf(mixed);
  expect(types).toEqual(["f450", "scout", "relay"]);
  const colours = mixed.map((each) => uavColour(each, "type", 1, types).join(" "));
  expect(colours[0]).toBe(colours[2]);
  expect(new Set(colours).size).toBe(3);
});
