import { describe, expect, it } from "vitest";
import { faultOf, USUAL } from "./fault.ts";

const FORM = { ...USUAL, uav: "uav2" };

describe("a fault", () => {
  it("is a table as in a scenario", () => {
    expect(faultOf({ ...FORM, kind: "motor", rotor: 3, thrustFactor: 0 }, 5)).toEqual({
      kind: "motor",
      uav: "uav2",
      rotor: 3,
      thrust_factor: 0,
    });
    expect(faultOf({ ...FORM, kind: "displacement", vector: [0, 1, 2] }, 5)).toEqual({
      kind: "displacement",
      uav: "uav2",
      offset_m: [0, 1, 2],
    });
  });

  it("ends after so long from now", () => {
    const passing = faultOf({ ...FORM, kind: "gnss_loss", lastsS: 2 }, 5);
    expect(passing).toEqual({ kind: "gnss_loss", uav: "uav2", until_s: 7 });
  });

  it("has a bias only where it is one", () => {
    const sensor = { ...FORM, kind: "sensor" as const, bias: "0.1, -2 ;3" };
    expect(faultOf(sensor, 0)).not.toHaveProperty("bias");
    expect(faultOf({ ...sensor, effect: "biased" }, 0)).toMatchObject({ bias: [0.1, -2, 3] });
  });

  it("has a standard deviation only where it is noise", () => {
    const sensor = { ...FORM, kind: "sensor" as const, effect: "noisy", sigma: "0.5 1" };
    expect(faultOf(sensor, 0)).toMatchObject({ effect: "noisy", sigma: [0.5, 1] });
    expect(faultOf(sensor, 0)).not.toHaveProperty("bias");
    expect(faultOf({ ...sensor, effect: "stuck" }, 0)).not.toHaveProperty("sigma");
  });

  it("of the radio channel has a position and is of no UAV", () => {
    const jammer = { ...FORM, kind: "jamming" as const, lastsS: 2 };
    expect(faultOf({ ...jammer, vector: [60, 0, 5], powerDbm: 25 }, 5)).toEqual({
      kind: "jamming",
      until_s: 7,
      position_m: [60, 0, 5],
      power_dbm: 25,
    });
  });

  it("of the air is of no UAV", () => {
    expect(faultOf({ ...FORM, kind: "gust" }, 0)).not.toHaveProperty("uav");
  });
});
