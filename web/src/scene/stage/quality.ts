import type { QualityWish } from "../../state/view.ts";

/** How much work a frame may be. */
export interface Quality {
  name: Exclude<QualityWish, "auto">;
  /** Maximum pixels of the canvas per CSS pixel. */
  pixelRatio: number;
  /** Side of the shadow map; 0: no shadows. */
  shadowMap: number;
  /** Until here trees are whole, beyond it they are impostors, m. */
  wholeTreesM: number;
  clouds: boolean;
  /** Maximum number of drops or flakes. */
  particles: number;
  /** Maximum number of LIDAR returns at a time. */
  returns: number;
}

export const LEVELS: readonly Quality[] = [
  level("minimal", 0.6, 0, 14, false, 400, 8_000),
  level("low", 1, 0, 28, false, 1_500, 20_000),
  level("medium", 1.5, 1024, 50, true, 5_000, 60_000),
  level("high", 2, 2048, 80, true, 12_000, 120_000),
];

function level(
  name: Quality["name"],
  pixelRatio: number,
  shadowMap: number,
  wholeTreesM: number,
  clouds: boolean,
  particles: number,
  returns: number,
): Quality {
  return { name, pixelRatio, shadowMap, wholeTreesM, clouds, particles, returns };
}

const SLOW_MS = 45;
const FAST_MS = 19;
const SLOW_FOR_MS = 1500;
const FAST_FOR_MS = 6000;

/** Chooses the level from the time that frames take: down soon, up late and never back and forth. */
export class QualityGovernor {
  level: number;
  private ceiling = LEVELS.length - 1;
  private slowMs = 0;
  private fastMs = 0;
  private meanMs = 25;

  constructor(start: number) {
    this.level = start;
  }

  /** Take the length of one more frame, ms; whether the level has changed. */
  take(frameMs: number): boolean {
    if (frameMs > 1000) return false; // the page was hidden
    this.meanMs += 0.1 * (frameMs - this.meanMs);
    this.slowMs = this.meanMs > SLOW_MS ? this.slowMs + frameMs : 0;
    this.fastMs = this.meanMs < FAST_MS ? this.fastMs + frameMs : 0;
    if (this.slowMs > SLOW_FOR_MS && this.level > 0) {
      this.ceiling = this.level - 1;
      return this.change(-1);
    }
    if (this.fastMs > FAST_FOR_MS && this.level < this.ceiling) return this.change(1);
    return false;
  }

  private change(by: number): boolean {
    this.level += by;
    this.slowMs = this.fastMs = 0;
    this.meanMs = 25;
    return true;
  }
}

let software: boolean | null = null;

/** Whether the processor draws WebGL: checked once, before the scene's own context is made. */
export function isSoftware(): boolean {
  software ??= asked();
  return software;
}

function asked(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (gl === null) return false;
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  const name = names === null ? "" : String(gl.getParameter(names.UNMASKED_RENDERER_WEBGL));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

export function levelNamed(wish: QualityWish): number {
  return LEVELS.findIndex(({ name }) => name === wish);
}
