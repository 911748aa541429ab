import { describe, expect, it } from "vitest";
import type { ServerStatus } from "./simulation.ts";
import { situationOf } from "./situation.ts";

const SERVER: ServerStatus = {
  state: "flying",
  scenario: "hover",
  description: "",
  message: "",
  world: null,
  version: "0.1.0",
  role: "operator",
  token_needed: false,
};

describe("the situation", () => {
  it("is what a server that answers reports", () => {
    for (const state of ["building", "failed", "no_world"] as const)
      expect(situationOf({ ...SERVER, state }, true, "open", false)).toBe(state);
    expect(situationOf(SERVER, true, "open", false)).toBe("flying");
    expect(situationOf(SERVER, true, "open", true)).toBe("ended");
  });

  it("is not the last report of a server that is gone", () => {
    for (const state of ["building", "no_world"] as const)
      expect(situationOf({ ...SERVER, state }, false, "lost", false)).toBe("flying");
    expect(situationOf(SERVER, false, "lost", true)).toBe("flying");
  });

  it("asks for a token", () => {
    expect(situationOf({ ...SERVER, token_needed: true }, true, "lost", false)).toBe(
      "token_needed",
    );
    expect(situationOf(SERVER, true, "refused", false)).toBe("token_needed");
  });
});
