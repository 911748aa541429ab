/** Blocked cells dark, free ones pale and nearly clear, unknown ones clear. */
const BLOCKED = [24, 32, 44, 225] as const;
const FREE = [240, 246, 250, 70] as const;

/** Pixels (RGBA) of an occupancy grid, row by row from its origin; null: it has too few cells. */
export function pixelsOfGrid(
  data: ArrayLike<number>,
  width: number,
  height: number,
): Uint8Array<ArrayBuffer> | null {
  const count = width * height;
  if (!(count > 0) || data.length < count) return null;
  const pixels = new Uint8Array(4 * count);
  for (let i = 0; i < count; i++) {
    const value = data[i]!;
    if (!(value >= 0 && value <= 100)) continue; // -1: unknown
    const share = value / 100;
    for (let k = 0; k < 4; k++) pixels[4 * i + k] = FREE[k]! + share * (BLOCKED[k]! - FREE[k]!);
  }
  return pixels;
}
