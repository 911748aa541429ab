import { beforeEach, expect, test, vi } from "vitest";
import type { ServerStatus } from "./simulation.ts";

vi.mock("../link/link.ts", () => ({ link: {} }));

const { useSimulation } = await import("./simulation.ts");
const { welcome } = await import("./welcome.ts");
const { closeWindow, useWindows } = await import("./windows.ts");

const STATUS = { unasked: true, role: "operator", token_needed: false } as ServerStatus;

function openedBy(server: ServerStatus | null): string | null {
  useSimulation.setState({ server });
  return useWindows.getState().open;
}

beforeEach(() => {
  closeWindow();
  useSimulation.setState({ server: null });
});

test("where no scenario was named, the page begins with the choice, once", () => {
  welcome("#quality=low");
  expect(openedBy({ ...STATUS, token_needed: true })).toBeNull();
  expect(openedBy(STATUS)).toBe("scenarios");
  closeWindow();
  expect(openedBy({ ...STATUS })).toBeNull();
});

test.each([
  ["a scenario was named", "", { ...STATUS, unasked: false }],
  ["a viewer cannot choose", "", { ...STATUS, role: "viewer" as const }],
  ["a link says what to show", "#view=chase&uav=uav2", STATUS],
])("no choice is offered where %s", (_why, hash, server) => {
  welcome(hash);
  expect(openedBy(server)).toBeNull();
});
