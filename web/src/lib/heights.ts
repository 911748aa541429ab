// The ground as a raster of heights, from the triangles of its mesh.

export interface Heights {
  /** South-west corner of the raster, m. */
  x: number;
  y: number;
  /** Side of a cell, m. */
  cell: number;
  columns: number;
  rows: number;
  /** At the middles of cells, row by row from the south; NaN: no ground there. m */
  z: Float32Array;
}

/** Corners of triangles, nine numbers each: x y z, m, in the map. */
export type Triangles = Float32Array;

/** The highest surface in each cell; null where there are no triangles. */
export function heightsOf(triangles: Triangles, maxCells: number): Heights | null {
  const box = boxOf(triangles);
  if (box === null) return null;
  const [width, depth] = [box.right - box.left, box.top - box.bottom];
  const cell = Math.max(width, depth, 1e-3) / maxCells;
  const columns = Math.max(1, Math.ceil(width / cell - 1e-9));
  const rows = Math.max(1, Math.ceil(depth / cell - 1e-9));
  const z = new Float32Array(columns * rows).fill(NaN);
  const heights = { x: box.left, y: box.bottom, cell, columns, rows, z };
  for (let at = 0; at + 9 <= triangles.length; at += 9) lay(heights, triangles, at);
  return heights;
}

/** Height of the ground, m; NaN beside it. */
export function heightIn(heights: Heights, x: number, y: number): number {
  const column = Math.floor((x - heights.x) / heights.cell);
  const row = Math.floor((y - heights.y) / heights.cell);
  if (column < 0 || row < 0 || column >= heights.columns || row >= heights.rows) return NaN;
  return heights.z[row * heights.columns + column]!;
}

const NEAREST_STEP_M = 0.05;
const FARTHEST_M = 5000;

/** Where a ray first meets the ground; `dir` is a unit vector. Null: nowhere. */
export function meetGround(
  heightAt: (x: number, y: number) => number,
  from: readonly [number, number, number],
  dir: readonly [number, number, number],
): [number, number, number] | null {
  const at = (t: number): [number, number, number] => [
    from[0] + dir[0] * t,
    from[1] + dir[1] * t,
    from[2] + dir[2] * t,
  ];
  const above = (t: number) => {
    const [x, y, z] = at(t);
    return z - heightAt(x, y);
  };
  let t = 0;
  while (t < FARTHEST_M) {
    const room = above(t);
    if (room <= 0) return t === 0 ? null : at(crossing(above, t));
    t += Math.max(NEAREST_STEP_M, room * 0.5, t * 0.002);
  }
  return null;
}

/** The ray is above the ground some distance before `t` and below at `t`. */
function crossing(above: (t: number) => number, t: number): number {
  let [low, high] = [Math.max(0, t - Math.max(1, t * 0.5)), t];
  if (above(low) <= 0) low = 0;
  for (let i = 0; i < 40; i++) {
    const middle = (low + high) / 2;
    if (above(middle) > 0) low = middle;
    else high = middle;
  }
  return high;
}

function boxOf(triangles: Triangles) {
  if (triangles.length < 9) return null;
  let [left, right, bottom, top] = [Infinity, -Infinity, Infinity, -Infinity];
  for (let i = 0; i < triangles.length; i += 3) {
    left = Math.min(left, triangles[i]!);
    right = Math.max(right, triangles[i]!);
    bottom = Math.min(bottom, triangles[i + 1]!);
    top = Math.max(top, triangles[i + 1]!);
  }
  return { left, right, bottom, top };
}

/** Raise the cells whose middles are in a triangle. */
function lay({ x, y, cell, columns, rows, z }: Heights, t: Triangles, at: number): void {
  const [ax, ay, az, bx, by, bz, cx, cy, cz] = t.subarray(at, at + 9) as unknown as number[];
  const area = (bx! - ax!) * (cy! - ay!) - (cx! - ax!) * (by! - ay!);
  if (Math.abs(area) < 1e-12) return;
  const first = (v: number, from: number, count: number) =>
    Math.max(0, Math.min(count, Math.ceil((v - from) / cell - 0.5 - 1e-6)));
  const last = (v: number, from: number, count: number) =>
    Math.max(-1, Math.min(count - 1, Math.floor((v - from) / cell - 0.5 + 1e-6)));
  const [low, high] = [
    first(Math.min(ay!, by!, cy!), y, rows),
    last(Math.max(ay!, by!, cy!), y, rows),
  ];
  const left = first(Math.min(ax!, bx!, cx!), x, columns);
  const right = last(Math.max(ax!, bx!, cx!), x, columns);
  for (let row = low; row <= high; row++) {
    const py = y + (row + 0.5) * cell;
    for (let column = left; column <= right; column++) {
      const px = x + (column + 0.5) * cell;
      const wb = ((px - ax!) * (cy! - ay!) - (cx! - ax!) * (py - ay!)) / area;
      const wc = ((bx! - ax!) * (py - ay!) - (px - ax!) * (by! - ay!)) / area;
      if (wb < -1e-6 || wc < -1e-6 || wb + wc > 1 + 1e-6) continue;
      const height = az! + wb * (bz! - az!) + wc * (cz! - az!);
      const i = row * columns + column;
      if (!(z[i]! >= height)) z[i] = height;
    }
  }
}
