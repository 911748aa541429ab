// The map seen from above: x to the right is east, y up is north.

export interface MapView {
  /** Position in the middle, m. */
  x: number;
  y: number;
  /** Pixels a metre. */
  scale: number;
}

export interface Size {
  width: number;
  height: number;
}

export type Point = [number, number];

const MIN_SCALE = 0.05;
const MAX_SCALE = 200;

export function pixelOf(view: MapView, size: Size, x: number, y: number): Point {
  return [size.width / 2 + (x - view.x) * view.scale, size.height / 2 - (y - view.y) * view.scale];
}

export function positionOf(view: MapView, size: Size, px: number, py: number): Point {
  return [
    view.x + (px - size.width / 2) / view.scale,
    view.y - (py - size.height / 2) / view.scale,
  ];
}

/** Nearer or farther; what is under the pixel stays there. */
export function zoomed(view: MapView, size: Size, factor: number, px: number, py: number): MapView {
  const scale = Math.max(MIN_SCALE, Math.min(MAX_SCALE, view.scale * factor));
  const [x, y] = positionOf(view, size, px, py);
  const ratio = view.scale / scale;
  return { x: x + (view.x - x) * ratio, y: y + (view.y - y) * ratio, scale };
}

export function panned(view: MapView, dx: number, dy: number): MapView {
  return { ...view, x: view.x - dx / view.scale, y: view.y + dy / view.scale };
}

/** All of the points with some room around; nearest when there is one alone. */
export function fitted(points: readonly Point[], size: Size, minM = 20): MapView {
  if (points.length === 0) return { x: 0, y: 0, scale: 4 };
  const xs = points.map(([x]) => x);
  const ys = points.map(([, y]) => y);
  const [left, right] = [Math.min(...xs), Math.max(...xs)];
  const [low, high] = [Math.min(...ys), Math.max(...ys)];
  const scale = Math.min(
    size.width / Math.max(minM, (right - left) * 1.2),
    size.height / Math.max(minM, (high - low) * 1.2),
  );
  return { x: (left + right) / 2, y: (low + high) / 2, scale };
}

/** The view of a map that has not been moved: fitted again when what is to be seen changes. */
export class AutoFit {
  private view: MapView | null = null;
  private key: readonly unknown[] = [];

  /** key: what has to change for another fit. points: what is to be seen then. */
  of(key: readonly unknown[], points: () => readonly Point[], size: Size): MapView {
    const same = key.length === this.key.length && key.every((part, i) => part === this.key[i]);
    if (this.view === null || !same) this.view = fitted(points(), size);
    this.key = key;
    return this.view;
  }

  clear(): void {
    this.view = null;
  }
}

/** A round length for the scale bar, at most `pixels` long: 1, 2 or 5 times a power of ten, m. */
export function barLength(scale: number, pixels: number): number {
  const maxM = pixels / scale;
  const power = 10 ** Math.floor(Math.log10(maxM));
  return ([5, 2].find((digit) => digit * power <= maxM) ?? 1) * power;
}
