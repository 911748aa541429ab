import { describe, expect, it } from "vitest";
import { daylightOf, extinctionOf, FAIR } from "./daylight.ts";

const sum = (colour: readonly number[]) => colour.reduce((a, b) => a + b, 0);
const at = (degrees: number, changes = {}) =>
  daylightOf({ ...FAIR, sunElevation: (degrees * Math.PI) / 180, ...changes });

describe("daylight", () => {
  it("fades contrasts to 5 % at the meteorological optical range", () => {
    for (const visibility of [50, 400, 20_000])
      expect(Math.exp(-extinctionOf(visibility) * visibility)).toBeCloseTo(0.05, 9);
    expect(extinctionOf(0)).toBe(0);
  });

  it("points to the sun: azimuth clockwise from north", () => {
    const [x, y, z] = daylightOf({ ...FAIR, sunElevation: 0, sunAzimuth: Math.PI / 2 }).towardsSun;
    expect([x, y, z].map((v) => Math.round(v * 1e9) / 1e9)).toEqual([1, 0, 0]);
  });

  it("grows with the height of the sun and is dark at night", () => {
    const heights = [-30, -4, 2, 10, 30, 60].map((degrees) => at(degrees));
    const skies = heights.map(({ above }) => sum(above));
    for (let i = 1; i < skies.length; i++) expect(skies[i]!).toBeGreaterThanOrEqual(skies[i - 1]!);
    expect(heights[0]!.night).toBe(1);
    expect(heights[5]!.night).toBe(0);
    expect(sum(heights[0]!.haze)).toBeLessThan(0.1 * sum(heights[5]!.haze));
  });

  it("has a red sun when it is low", () => {
    const [r, g, b] = at(4).sun;
    expect(r).toBeGreaterThan(1.3 * g);
    expect(g).toBeGreaterThan(1.3 * b);
  });

  it("loses the sun in rain and fog", () => {
    expect(sum(at(50, { rain: 10 }).sun)).toBeLessThan(0.4 * sum(at(50).sun));
    expect(sum(at(50, { visibility: 100 }).sun)).toBeLessThan(0.2 * sum(at(50).sun));
  });

  it("is brown in dust", () => {
    const [r, , b] = at(50, { visibility: 500, dustVisibility: 500 }).haze;
    expect(r).toBeGreaterThan(1.5 * b);
  });
});
