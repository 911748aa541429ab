import { expect, it } from "vitest";
import { ownEntry } from "./ownEntry.ts";

it("finds what a record holds, and nothing that it inherits", () => {
  expect(ownEntry({ hold: "teal" }, "hold")).toBe("teal");
  for (const name of ["constructor", "__proto__", "toString", "land"])
    expect(ownEntry({ hold: "teal" }, name)).toBeUndefined();
});
