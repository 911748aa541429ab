import type { BufferGeometry } from "three";

const CELL_M = 8;

/** Height of the ground anywhere, from its triangles, sorted into the cells of a grid. */
export class Ground {
  private readonly cells = new Map<number, number[]>();
  /** Nine numbers a triangle. */
  private readonly corners: Float64Array;
  private readonly lowest: number;
  private readonly xMin: number = 0;
  private readonly yMin: number = 0;
  private readonly columns: number = 1;
  private readonly large: number[] = [];

  constructor(geometries: readonly BufferGeometry[]) {
    this.corners = cornersOf(geometries);
    let [xMin, yMin, xMax, low] = [Infinity, Infinity, -Infinity, Infinity];
    for (let i = 0; i < this.corners.length; i += 3) {
      xMin = Math.min(xMin, this.corners[i]!);
      xMax = Math.max(xMax, this.corners[i]!);
      yMin = Math.min(yMin, this.corners[i + 1]!);
      low = Math.min(low, this.corners[i + 2]!);
    }
    this.lowest = Number.isFinite(low) ? low : 0;
    if (!Number.isFinite(xMin)) return;
    this.xMin = xMin;
    this.yMin = yMin;
    this.columns = Math.floor((xMax - xMin) / CELL_M) + 1;
    for (let t = 0; t < this.corners.length; t += 9) this.sort(t);
  }

  /** Highest ground at a position, m; beside the ground its lowest height. */
  heightAt(x: number, y: number): number {
    let height = -Infinity;
    for (const t of this.cells.get(this.cell(x, y)) ?? [])
      height = Math.max(height, this.on(t, x, y));
    for (const t of this.large) height = Math.max(height, this.on(t, x, y));
    return height > -Infinity ? height : this.lowest;
  }

  private cell(x: number, y: number): number {
    const column = Math.floor((x - this.xMin) / CELL_M);
    if (column < 0 || column >= this.columns) return -1;
    return Math.floor((y - this.yMin) / CELL_M) * this.columns + column;
  }

  private sort(t: number): void {
    const c = this.corners;
    const xs = [c[t]!, c[t + 3]!, c[t + 6]!];
    const ys = [c[t + 1]!, c[t + 4]!, c[t + 7]!];
    const [left, right] = [Math.min(...xs), Math.max(...xs)];
    const [south, north] = [Math.min(...ys), Math.max(...ys)];
    if ((right - left) * (north - south) > (20 * CELL_M) ** 2) {
      this.large.push(t);
      return;
    }
    for (let y = south; y < north + CELL_M; y += CELL_M)
      for (let x = left; x < right + CELL_M; x += CELL_M) {
        const cell = this.cell(Math.min(x, right), Math.min(y, north));
        const there = this.cells.get(cell);
        if (there === undefined) this.cells.set(cell, [t]);
        else if (there.at(-1) !== t) there.push(t);
      }
  }

  /** Height of triangle `t` at a position; -Infinity beside it. */
  private on(t: number, x: number, y: number): number {
    const c = this.corners;
    const [ax, ay, bx, by] = [c[t]!, c[t + 1]!, c[t + 3]!, c[t + 4]!];
    const [cx, cy] = [c[t + 6]!, c[t + 7]!];
    const area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
    if (Math.abs(area) < 1e-9) return -Infinity;
    const v = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area;
    const w = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area;
    if (v < -1e-6 || w < -1e-6 || v + w > 1 + 1e-6) return -Infinity;
    return c[t + 2]! + v * (c[t + 5]! - c[t + 2]!) + w * (c[t + 8]! - c[t + 2]!);
  }
}

/** Corners of all triangles, nine numbers each. */
export function cornersOf(geometries: readonly BufferGeometry[]): Float64Array {
  const corners: number[] = [];
  for (const geometry of geometries) {
    const position = geometry.getAttribute("position");
    const count = geometry.index?.count ?? position.count;
    for (let i = 0; i < count; i++) {
      const at = geometry.index === null ? i : geometry.index.getX(i);
      corners.push(position.getX(at), position.getY(at), position.getZ(at));
    }
  }
  return Float64Array.from(corners);
}
