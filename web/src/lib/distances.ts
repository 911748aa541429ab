// How far UAVs are from one another, as a distribution.

import { roundAbove } from "./roundAbove.ts";

/** Distances that are looked at, at most: of a larger fleet those of every k-th UAV. */
const MAX_NEAREST = 1_000_000;
const MAX_PAIRS = 200_000;
const MAX_BINS = 40;

export interface Histogram {
  /** Of a bin, m; the first begins at 0. */
  width: number;
  /** Share of the distances in each bin, %. */
  shares: number[];
}

/** Distance of each UAV to the one that is nearest to it, m; `positions`: x y z of each in turn. */
export function nearestDistances(positions: ArrayLike<number>): number[] {
  const count = positions.length / 3;
  if (count < 2) return [];
  const stride = Math.ceil((count * count) / MAX_NEAREST);
  const found: number[] = [];
  for (let i = 0; i < count; i += stride) {
    let nearest = Infinity;
    for (let j = 0; j < count; j++) {
      if (j !== i) nearest = Math.min(nearest, square(positions, i, j));
    }
    found.push(Math.sqrt(nearest));
  }
  return found;
}

/** Distances of all pairs, m. */
export function pairDistances(positions: ArrayLike<number>): number[] {
  const count = positions.length / 3;
  const stride = Math.max(1, Math.ceil((count * (count - 1)) / 2 / MAX_PAIRS));
  const found: number[] = [];
  for (let i = 0; i < count; i++) {
    // Rows begin apart: neighbours in the list, which are often near, count no more than others.
    for (let j = i + 1 + (i % stride); j < count; j += stride)
      found.push(Math.sqrt(square(positions, i, j)));
  }
  return found;
}

function square(positions: ArrayLike<number>, i: number, j: number): number {
  const dx = positions[3 * i]! - positions[3 * j]!;
  const dy = positions[3 * i + 1]! - positions[3 * j + 1]!;
  const dz = positions[3 * i + 2]! - positions[3 * j + 2]!;
  return dx * dx + dy * dy + dz * dz;
}

/** Their distribution in bins whose width is a round number. */
export function histogramOf(distances: readonly number[]): Histogram {
  let farthest = 0;
  for (const distance of distances) farthest = Math.max(farthest, distance);
  const width = farthest > 0 ? roundAbove(farthest / (MAX_BINS - 1)) : 1;
  const shares = Array.from({ length: Math.floor(farthest / width) + 1 }, () => 0);
  for (const distance of distances) shares[Math.floor(distance / width)]! += 100 / distances.length;
  return { width, shares };
}

/** The distribution as CSV. */
export function histogramCsv({ width, shares }: Histogram): string {
  const edge = (i: number) => Number((i * width).toPrecision(12));
  const rows = shares.map((share, i) => `${edge(i)},${edge(i + 1)},${share}`);
  return ["from_m,to_m,percent", ...rows].join("\n") + "\n";
}
