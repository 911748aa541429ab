import { expect, it } from "vitest";
import { failureText, inWaves } from "./inWaves.ts";

it("asks all, so many at a time, and keeps the reasons of those that fail", async () => {
  const names = Array.from({ length: 10 }, (_, i) => `uav${i + 1}`);
  let open = 0;
  let maxOpen = 0;
  const asked: string[] = [];
  const failed = await inWaves(names, 3, async (name) => {
    asked.push(name);
    maxOpen = Math.max(maxOpen, ++open);
    await Promise.resolve();
    open--;
    if (name === "uav4") throw new Error("it has crashed");
  });
  expect(asked).toEqual(names);
  expect(maxOpen).toBe(3);
  expect([...failed]).toEqual([["uav4", "it has crashed"]]);
});

it("says how many failed, which, and why", () => {
  const failed = new Map(["a", "b", "c", "d"].map((name) => [name, "low battery"]));
  expect(failureText(failed, 9)).toBe("4 of 9 UAVs (a, b, c, …): low battery");
  failed.set("b", "crashed");
  failed.delete("d");
  expect(failureText(failed, 9)).toBe("3 of 9 UAVs (a, b, c): low battery (and 1 other reason)");
});
