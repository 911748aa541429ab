import { describe, expect, it } from "vitest";
import { ADDRESS, offeredPanels } from "./tensorboard.ts";

const PANELS = [{ id: "plots" }, { id: "tensorboard" }];

describe("the panel TensorBoard", () => {
  it("is there only if the server offers it", () => {
    expect(offeredPanels(PANELS, { tensorboard: true })).toEqual(PANELS);
    expect(offeredPanels(PANELS, { tensorboard: false })).toEqual([{ id: "plots" }]);
    expect(offeredPanels(PANELS, {})).toEqual([{ id: "plots" }]);
    expect(offeredPanels(PANELS, null)).toEqual([{ id: "plots" }]);
  });

  it("has an address below any prefix", () => {
    const { pathname, origin } = new URL(ADDRESS, "http://host/lab/sim1/");
    expect(origin + pathname).toBe("http://host/lab/sim1/tensorboard/");
  });
});
