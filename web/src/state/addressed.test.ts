import { beforeEach, expect, it, vi } from "vitest";

const page = { hash: "" };
vi.stubGlobal("location", page);
vi.stubGlobal("history", {
  state: null,
  replaceState: (_state: unknown, _title: string, url: string) => (page.hash = url),
});
const follow = vi.fn<(event: string, read: () => void) => void>();
vi.stubGlobal("window", { addEventListener: follow });
vi.mock("../link/link.ts", () => ({ link: { subscribe: () => () => undefined } }));

const { followAddress } = await import("./addressed.ts");
const { useSimulation } = await import("./simulation.ts");
const { closeWindow, useWindows } = await import("./windows.ts");

const flying = (scenario: string) =>
  useSimulation.setState({
    server: { scenario } as ReturnType<typeof useSimulation.getState>["server"],
  });

page.hash = "#view=fly&scenario=city_flight";
followAddress();
const read = follow.mock.calls[0]![1];

beforeEach(closeWindow);

it("another scenario than the running one is offered once, and the address names the running one", () => {
  flying("hover");
  expect(useWindows.getState()).toMatchObject({ open: "scenarios", scenario: "city_flight" });
  expect(new URLSearchParams(page.hash.slice(1)).get("scenario")).toBe("hover");
  closeWindow();
  flying("forest_survey");
  expect(useWindows.getState().open).toBeNull();
  expect(new URLSearchParams(page.hash.slice(1)).get("scenario")).toBe("forest_survey");
});

it("a link to what flies offers nothing, one that is typed later may", () => {
  page.hash = "#scenario=forest_survey";
  read();
  expect(useWindows.getState().open).toBeNull();
  page.hash = "#scenario=hover";
  read();
  expect(useWindows.getState()).toMatchObject({ open: "scenarios", scenario: "hover" });
});
