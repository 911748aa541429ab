/** The box around points, and how far away a camera sees all of it. */
export interface Frame {
  middle: [number, number, number];
  /** From the middle to the farthest corner of the box, m. */
  radius: number;
}

const MARGIN = 1.1;

/** Collects points (m, map) one at a time, without garbage; call `clear` first. */
export class FrameBox {
  private readonly low = [Infinity, Infinity, Infinity];
  private readonly high = [-Infinity, -Infinity, -Infinity];

  clear(): void {
    this.low.fill(Infinity);
    this.high.fill(-Infinity);
  }

  add(...point: [number, number, number]): void {
    for (let i = 0; i < 3; i++) {
      this.low[i] = Math.min(this.low[i]!, point[i]!);
      this.high[i] = Math.max(this.high[i]!, point[i]!);
    }
  }

  /** Write what encloses all points; a box without points leaves `out` as it is. */
  measure(out: Frame): void {
    const { low, high } = this;
    if (low[0]! > high[0]!) return;
    for (let i = 0; i < 3; i++) out.middle[i] = (low[i]! + high[i]!) / 2;
    out.radius = 0.5 * Math.hypot(...high.map((value, i) => value - low[i]!));
  }
}

/** Distance, m, from which a sphere fits the view; `fov`: vertical, degrees. */
export function fittingDistance(radius: number, fov: number, aspect: number): number {
  const vertical = (fov * Math.PI) / 360;
  const horizontal = Math.atan(Math.tan(vertical) * aspect);
  return (MARGIN * radius) / Math.sin(Math.min(vertical, horizontal));
}
