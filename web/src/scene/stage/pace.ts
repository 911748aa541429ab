const SHORTEST_MS = 28;
/** Rest after a frame, as a fraction of the time that it took. */
const REST_FRACTION = 0.8;
const LONGEST_REST_MS = 200;
/** A lost context never says that a frame is drawn. */
const DRAWN_AFTER_MS = 1000;

/**
 * Decides when a processor that draws begins the next frame. It has other work too: the page's and,
 * more often than not, the simulation's. So it never has two frames to draw, which would block the
 * page's script until one is done, and rests after each.
 */
export class DrawingPace {
  /** Time that the last frame took, ms. */
  costMs = SHORTEST_MS;
  private begunMs = -Infinity;
  private drawnMs = -Infinity;
  private restMs = 0;
  private isDrawing = false;

  /** Whether the next frame may begin now, ms; `isDrawn` says whether the last is on the screen. */
  mayBegin(nowMs: number, isDrawn: () => boolean): boolean {
    const sinceMs = nowMs - this.begunMs;
    if (this.isDrawing) {
      if (sinceMs < DRAWN_AFTER_MS && !isDrawn()) return false;
      this.isDrawing = false;
      this.costMs = Math.max(SHORTEST_MS, sinceMs);
      this.restMs = Math.min(LONGEST_REST_MS, REST_FRACTION * sinceMs);
      this.drawnMs = nowMs;
    }
    return sinceMs >= SHORTEST_MS && nowMs - this.drawnMs >= this.restMs;
  }

  begin(nowMs: number): void {
    this.begunMs = nowMs;
    this.isDrawing = true;
  }
}
