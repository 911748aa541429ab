const CELL_M = 4;

/** A trunk: a circle in the plan. */
interface Trunk {
  x: number;
  y: number;
  radius: number;
}

/** A wall's line in the plan, from `low` to `high`, m. */
interface Wall {
  ax: number;
  ay: number;
  bx: number;
  by: number;
  low: number;
  high: number;
}

/** What stops a walker: trunks and walls, sorted into the cells of a grid. */
export class Obstacles {
  private readonly trunks = new Map<string, Trunk[]>();
  private readonly walls = new Map<string, Wall[]>();

  addTrunk(x: number, y: number, radius: number): void {
    put(this.trunks, { x, y, radius }, x - radius, y - radius, x + radius, y + radius);
  }

  /** Corners of triangles, nine numbers each; those that stand steep are walls. */
  addWalls(corners: ArrayLike<number>): void {
    for (let t = 0; t + 8 < corners.length; t += 9) {
      const wall = wallOf(corners, t);
      if (wall === null) continue;
      const [left, right] = [Math.min(wall.ax, wall.bx), Math.max(wall.ax, wall.bx)];
      const [south, north] = [Math.min(wall.ay, wall.by), Math.max(wall.ay, wall.by)];
      put(this.walls, wall, left, south, right, north);
    }
  }

  /**
   * Returns where a walker of that radius ends that moves from one position towards another; feet
   * and head: the heights between which walls stop. The walker slides along obstacles.
   */
  walk(
    from: readonly [number, number],
    to: readonly [number, number],
    radius: number,
    feet: number,
    head: number,
  ): [number, number] {
    const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
    const steps = Math.max(1, Math.ceil(length / (0.5 * radius)));
    let [x, y] = from;
    for (let i = 0; i < steps; i++) {
      x += (to[0] - from[0]) / steps;
      y += (to[1] - from[1]) / steps;
      [x, y] = this.pushedOut(x, y, radius, feet, head);
    }
    return [x, y];
  }

  private pushedOut(
    x: number,
    y: number,
    radius: number,
    feet: number,
    head: number,
  ): [number, number] {
    for (let round = 0; round < 3; round++) {
      let free = true;
      const push = (px: number, py: number, clearance: number) => {
        const [dx, dy] = [x - px, y - py];
        const distance = Math.hypot(dx, dy);
        if (distance >= clearance - 1e-6) return;
        free = false;
        const [ux, uy] = distance > 1e-9 ? [dx / distance, dy / distance] : [1, 0];
        x = px + ux * clearance;
        y = py + uy * clearance;
      };
      for (const trunk of around(this.trunks, x, y)) push(trunk.x, trunk.y, trunk.radius + radius);
      for (const wall of around(this.walls, x, y)) {
        if (wall.high < feet || wall.low > head) continue;
        const [px, py] = nearest(wall, x, y);
        push(px, py, radius);
      }
      if (free) break;
    }
    return [x, y];
  }
}

function put<T>(
  cells: Map<string, T[]>,
  what: T,
  left: number,
  south: number,
  right: number,
  north: number,
): void {
  for (let j = Math.floor(south / CELL_M); j <= Math.floor(north / CELL_M); j++)
    for (let i = Math.floor(left / CELL_M); i <= Math.floor(right / CELL_M); i++) {
      const key = `${i} ${j}`;
      const there = cells.get(key);
      if (there === undefined) cells.set(key, [what]);
      else there.push(what);
    }
}

/** What is in the nine cells around a position. */
function* around<T>(cells: Map<string, T[]>, x: number, y: number): Generator<T> {
  const [i, j] = [Math.floor(x / CELL_M), Math.floor(y / CELL_M)];
  for (let dj = -1; dj <= 1; dj++)
    for (let di = -1; di <= 1; di++) yield* cells.get(`${i + di} ${j + dj}`) ?? [];
}

/** The line of a steep triangle: between those of its corners that are farthest apart in the plan. */
function wallOf(c: ArrayLike<number>, t: number): Wall | null {
  const corner = (k: number) => [c[t + 3 * k]!, c[t + 3 * k + 1]!, c[t + 3 * k + 2]!] as const;
  const [p, q, r] = [corner(0), corner(1), corner(2)];
  const u = [q[0] - p[0], q[1] - p[1], q[2] - p[2]] as const;
  const v = [r[0] - p[0], r[1] - p[1], r[2] - p[2]] as const;
  const nx = u[1] * v[2] - u[2] * v[1];
  const ny = u[2] * v[0] - u[0] * v[2];
  const nz = u[0] * v[1] - u[1] * v[0];
  if (!(Math.abs(nz) < 0.7 * Math.hypot(nx, ny, nz))) return null;
  const far = [
    [p, q],
    [q, r],
    [r, p],
  ].sort(([a, b], [d, e]) => span(d!, e!) - span(a!, b!))[0]!;
  const [a, b] = [far[0]!, far[1]!];
  return {
    ax: a[0],
    ay: a[1],
    bx: b[0],
    by: b[1],
    low: Math.min(p[2], q[2], r[2]),
    high: Math.max(p[2], q[2], r[2]),
  };
}

function span(a: readonly [number, number, number], b: readonly [number, number, number]): number {
  return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2;
}

function nearest({ ax, ay, bx, by }: Wall, x: number, y: number): [number, number] {
  const [dx, dy] = [bx - ax, by - ay];
  const square = dx * dx + dy * dy;
  const share = square > 0 ? ((x - ax) * dx + (y - ay) * dy) / square : 0;
  const t = Math.min(1, Math.max(0, share));
  return [ax + t * dx, ay + t * dy];
}
