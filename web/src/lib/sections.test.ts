import { expect, test } from "vitest";
import { sectionsOf } from "./sections.ts";

test("sections stand as the server orders them, after the visitor's own", () => {
  const cards = [
    { name: "hover", section: "Start here" },
    { name: "coverage", section: "Teams" },
    { name: "swarm_100", section: "Start here" },
    { name: "mine", section: "Yours" },
  ];
  const named = sectionsOf(cards).map(([section, inside]) => [section, inside.map((c) => c.name)]);
  expect(named).toEqual([
    ["Yours", ["mine"]],
    ["Start here", ["hover", "swarm_100"]],
    ["Teams", ["coverage"]],
  ]);
  expect(sectionsOf([])).toEqual([]);
});
