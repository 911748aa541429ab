import { describe, expect, it } from "vitest";
import { histogramCsv, histogramOf, nearestDistances, pairDistances } from "./distances.ts";

const LINE = [0, 0, 0, 3, 4, 0, 3, 4, 2]; // 5 m, then 2 m

function lattice(side: number, spacing: number): number[] {
  return Array.from({ length: side * side }, (_, i) => [
    spacing * (i % side),
    spacing * Math.floor(i / side),
    2,
  ]).flat();
}

describe("distances between UAVs", () => {
  it("of each to the nearest, and of all pairs", () => {
    expect(nearestDistances(LINE)).toEqual([5, 2, 2]);
    expect(pairDistances(LINE)).toEqual([5, Math.hypot(3, 4, 2), 2]);
    expect(nearestDistances([1, 2, 3])).toEqual([]);
    expect(pairDistances([])).toEqual([]);
  });

  it("of a large fleet are those of a part of it, as they are distributed", () => {
    const fleet = lattice(40, 4); // 1,600 UAVs, 1.3 million pairs
    const nearest = nearestDistances(fleet);
    expect(nearest.length).toBeGreaterThan(400);
    expect(new Set(nearest)).toEqual(new Set([4]));
    const pairs = pairDistances(fleet);
    expect(pairs.length).toBeLessThanOrEqual(200_000);
    expect(pairs.length).toBeGreaterThan(150_000);
    const near = pairs.filter((each) => each === 4).length / pairs.length;
    expect(near / ((2 * 40 * 39) / ((1600 * 1599) / 2))).toBeCloseTo(1, 1);
    // The mean distance of two random points of a square is 0.5214 of its side (Robbins, 1978).
    const mean = pairs.reduce((sum, each) => sum + each, 0) / pairs.length;
    expect(mean / 160).toBeCloseTo(0.5214, 2);
  });

  it("are counted in bins of a round width", () => {
    expect(histogramOf([0.1, 3.9, 4, 4.1])).toEqual({
      width: 0.2,
      shares: Array.from({ length: 21 }, (_, i) => ({ 0: 25, 19: 25, 20: 50 })[i] ?? 0),
    });
    expect(histogramOf([])).toEqual({ width: 1, shares: [0] });
    expect(histogramOf([0, 0])).toEqual({ width: 1, shares: [100] });
    const { shares, width } = histogramOf(pairDistances(lattice(12, 1.7)));
    expect(width).toBe(1);
    expect(shares.length).toBeLessThanOrEqual(40);
    expect(shares.reduce((sum, share) => sum + share, 0)).toBeCloseTo(100, 6);
  });

  it("are saved as a table", () => {
    expect(histogramCsv({ width: 0.2, shares: [75, 0, 0, 25] })).toBe(
      "from_m,to_m,percent\n0,0.2,75\n0.2,0.4,0\n0.4,0.6,0\n0.6,0.8,25\n",
    );
  });
});
