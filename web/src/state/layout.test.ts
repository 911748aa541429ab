// @vitest-environment happy-dom
import { beforeEach, describe, expect, it } from "vitest";
import {
  closePanel,
  openBeside,
  openPanel,
  putPanel,
  resetLayout,
  splitBottom,
  togglePanel,
  useLayout,
} from "./layout.ts";
import { restoreLayout, saveLayout } from "./savedLayouts.ts";

const halves = () => [useLayout.getState().bottom, useLayout.getState().second];

beforeEach(() => {
  window.innerWidth = 1440;
  resetLayout();
});

describe("two panels at the bottom", () => {
  it("stay where they are when one is opened again", () => {
    openPanel("bottom", "plots");
    putPanel("second", "log");
    openPanel("bottom", "log");
    expect(halves()).toEqual(["plots", "log"]);
  });

  it("are swapped where a half gets what the other one shows", () => {
    openPanel("bottom", "plots");
    putPanel("second", "log");
    putPanel("bottom", "log");
    expect(halves()).toEqual(["log", "plots"]);
  });

  it("close one by one; the right one takes the whole width", () => {
    openPanel("bottom", "plots");
    putPanel("second", "log");
    togglePanel("bottom", "plots");
    expect(halves()).toEqual(["log", ""]);
    putPanel("second", "plots");
    togglePanel("bottom", "plots");
    expect(halves()).toEqual(["log", ""]);
    closePanel("bottom");
    expect(halves()).toEqual(["", ""]);
  });

  it("open beside the one that asks, in whichever half that is", () => {
    openPanel("bottom", "topics");
    openBeside("topics", "plots");
    expect(halves()).toEqual(["topics", "plots"]);
    putPanel("second", "topics");
    putPanel("bottom", "log");
    openBeside("topics", "plots");
    expect(halves()).toEqual(["plots", "topics"]);
  });

  it("keep a width that can be used, wherever their border is dragged", () => {
    splitBottom(0.02, 1390);
    expect(useLayout.getState().split * 1390).toBeCloseTo(300);
    splitBottom(0.99, 1390);
    expect((1 - useLayout.getState().split) * 1390).toBeCloseTo(300);
    splitBottom(0.9, 500);
    expect(useLayout.getState().split).toBe(0.5);
  });

  it("are saved in layouts", () => {
    openPanel("bottom", "plots");
    putPanel("second", "services");
    splitBottom(0.7, 1390);
    saveLayout("two");
    resetLayout();
    expect(halves()).toEqual(["", ""]);
    restoreLayout("two");
    expect(halves()).toEqual(["plots", "services"]);
    expect(useLayout.getState().split).toBe(0.7);
  });

  it("are one on a phone", () => {
    openPanel("bottom", "topics");
    putPanel("second", "log");
    window.innerWidth = 390;
    openBeside("topics", "plots");
    expect(halves()).toEqual(["plots", ""]);
    openPanel("right", "inspector");
    expect(halves()).toEqual(["", ""]);
  });
});
