// @vitest-environment happy-dom
import { expect, test } from "vitest";
import { closePanel, openPanel, useLayout } from "./layout.ts";
import { addPlot, usePlots } from "./plots.ts";
import { deleteLayout, restoreLayout, saveLayout, useSavedLayouts } from "./savedLayouts.ts";

test("a saved layout brings panels and plots back", () => {
  openPanel("bottom", "plots");
  addPlot();
  const plots = usePlots.getState().plots.length;
  saveLayout("tuning");
  closePanel("bottom");
  usePlots.setState({ plots: [] });
  restoreLayout("tuning");
  expect(useLayout.getState().bottom).toBe("plots");
  expect(usePlots.getState().plots).toHaveLength(plots);
});

test("a deleted layout changes nothing any more", () => {
  saveLayout("old");
  deleteLayout("old");
  closePanel("bottom");
  restoreLayout("old");
  expect(useLayout.getState().bottom).toBe("");
  expect(Object.keys(useSavedLayouts.getState().saved)).not.toContain("old");
});
