import { describe, expect, it, vi } from "vitest";

vi.mock("../link/link.ts", () => ({ link: {} }));
const { problemOf } = await import("./problem.ts");
const { entryOfEvent, warningOf } = await import("./journal.ts");

describe("problem", () => {
  it("is nothing while all is well", () => {
    expect(problemOf("open", "", "the simulation", false)).toBeNull();
  });

  it("reports a lost link, and why", () => {
    const problem = problemOf("lost", "the world changes", "the simulation", false);
    expect(problem?.what).toBe("No connection to the simulation: the world changes");
    expect(problem?.linked).toBe(false);
  });

  it("reports silence of an open link", () => {
    const problem = problemOf("open", "", "ws://robot:9090", true);
    expect(problem).toMatchObject({ what: "No data from ws://robot:9090", linked: true });
  });
});

describe("an entry of the log", () => {
  const EVENT = {
    time_ns: 2_500_000_000,
    uav: "uav1",
    kind: "collision",
    position_map: [1, 2, 3],
    speed_m_s: 1.25,
    partner: "tree 7",
    detail: "",
  };

  it("says what was hit, how fast and where", () => {
    const entry = entryOfEvent(JSON.stringify(EVENT));
    expect(entry).toMatchObject({ timeS: 2.5, sort: "problem", source: "uav1" });
    expect(entry?.text).toBe("hit tree 7 at 1.25 m/s at (1.0, 2.0, 3.0) m");
  });

  it("of a falling battery gets a notice, that of a collision none", () => {
    const fallen = { ...EVENT, kind: "battery", partner: "", detail: "battery critical" };
    const entry = entryOfEvent(JSON.stringify(fallen));
    expect(entry).toMatchObject({ sort: "problem", source: "uav1" });
    expect(entry?.text).toBe("battery critical at (1.0, 2.0, 3.0) m");
    expect(entry && warningOf(entry)).toBe("uav1, 2.5 s");
    const collision = entryOfEvent(JSON.stringify(EVENT));
    expect(collision && warningOf(collision)).toBeNull();
  });

  it("is made of events alone", () => {
    expect(entryOfEvent("hello")).toBeNull();
    expect(entryOfEvent('{"a": 1}')).toBeNull();
    expect(entryOfEvent("null")).toBeNull();
  });
});
