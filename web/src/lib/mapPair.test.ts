import { expect, it } from "vitest";
import { missingHalfOf, offeredOf } from "./mapPair.ts";

const file = (name: string) => new File([], name);
const names = (...given: string[]) => {
  const offered = offeredOf(given.map(file));
  return offered && [offered.file.name, offered.image?.name ?? null];
};

it("a .yaml and an image are one map, in whatever order", () => {
  expect(names("room.pgm", "room.yaml")).toEqual(["room.yaml", "room.pgm"]);
  expect(names("room.YML", "notes.txt", "room.png")).toEqual(["room.YML", "room.png"]);
  expect(names("room.yaml")).toEqual(["room.yaml", null]);
  expect(names("plan.png", "other.png")).toEqual(["plan.png", null]);
  expect(names()).toBeNull();
});

it("half a map says what is missing", () => {
  expect(missingHalfOf("room.yaml", null)).toContain("both files");
  expect(missingHalfOf("room.pgm", null)).toContain(".yaml");
  expect(missingHalfOf("room.yaml", file("room.pgm"))).toBeNull();
  expect(missingHalfOf("plan.png", null)).toBeNull();
});
