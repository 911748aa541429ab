/** Positions of a square lattice, ever farther from the middle, m. */
export function spiral(count: number, spacing: number): [number, number][] {
  const positions: [number, number][] = [];
  for (let ring = 0; positions.length < count; ring++) {
    for (let x = 0 - ring; x <= ring; x++) {
      for (let y = 0 - ring; y <= ring; y++) {
        if (Math.max(Math.abs(x), Math.abs(y)) === ring) positions.push([x * spacing, y * spacing]);
      }
    }
  }
  return positions.slice(0, count);
}
