import { beforeEach, expect, test, vi } from "vitest";
import type { ServerStatus } from "./simulation.ts";

vi.mock("../link/link.ts", () => ({ link: {} }));

const { useSimulation } = await import("./simulation.ts");
const { welcome } = await import("./welcome.ts");
const { closeWindow, useWindows } = await import("./windows.ts");

const TOLD = { unasked: true, role: "operator", token_needed: false } as ServerStatus;

function tell(server: ServerStatus | null): string | null {
  useSimulation.setState({ server });
  return useWindows.getState().open;
}

beforeEach(() => {
  closeWindow();
  useSimulation.setState({ server: null });
});

test("where nobody has named what flies, the page begins with the choice, once", () => {
  welcome("#quality=low");
  expect(tell({ ...TOLD, token_needed: true })).toBeNull();
  expect(tell(TOLD)).toBe("scenarios");
  closeWindow();
  expect(tell({ ...TOLD })).toBeNull();
});

test.each([
  ["a scenario was named", "", { ...TOLD, unasked: false }],
  ["a viewer cannot choose", "", { ...TOLD, role: "viewer" as const }],
  ["a link says what to show", "#view=chase&uav=uav2", TOLD],
])("no choice is offered where %s", (_why, hash, server) => {
  welcome(hash);
  expect(tell(server)).toBeNull();
});
