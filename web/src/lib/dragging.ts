// Positions under a dragged pointer.

type Vector = readonly [number, number, number];

export interface Ray {
  origin: Vector;
  direction: Vector;
}

/** So flat rays meet the plane too far away to be meant. */
const MIN_SLOPE = 0.02;

/** Where a ray meets the level plane at height z; null: nowhere that is meant. */
export function onLevel({ origin, direction }: Ray, z: number): [number, number] | null {
  const t = (z - origin[2]) / direction[2];
  if (!Number.isFinite(t) || t <= 0 || Math.abs(direction[2]) < MIN_SLOPE) return null;
  return [origin[0] + direction[0] * t, origin[1] + direction[1] * t];
}

/** Height on the upright line through x, y that is nearest to a ray; null: it looks straight down. */
export function onUpright({ origin, direction }: Ray, x: number, y: number): number | null {
  const level = direction[0] ** 2 + direction[1] ** 2;
  if (level < MIN_SLOPE ** 2) return null;
  const t = ((x - origin[0]) * direction[0] + (y - origin[1]) * direction[1]) / level;
  return t > 0 ? origin[2] + direction[2] * t : null;
}
