/** The page shows a pose until this long after it came, ms: what follows it may begin then. */
const SETTLE_MS = 500;

interface Restart {
  /** Simulated time of the command that put the UAV back to its start, s. */
  stampS: number;
  /** Wall time at which its first pose after that came, ms; NaN: none yet. */
  sinceMs: number;
}

/**
 * UAVs that are put back to their start while the others fly on. The command is known before the
 * pose follows it, and the scene moves on from the pose before: until then there is no trail.
 */
export class Restarts {
  private readonly open = new Map<string, Restart>();

  note(uav: string, stampS: number): void {
    this.open.set(uav, { stampS, sinceMs: NaN });
  }

  get isEmpty(): boolean {
    return this.open.size === 0;
  }

  /** Whether a UAV is on the way to its start; `poseS` is the stamp of the newest poses. */
  includes(uav: string, poseS: number, nowMs: number): boolean {
    const restart = this.open.get(uav);
    if (restart === undefined) return false;
    if (Number.isNaN(restart.sinceMs) && poseS > restart.stampS) restart.sinceMs = nowMs;
    if (!(nowMs - restart.sinceMs > SETTLE_MS)) return true;
    this.open.delete(uav);
    return false;
  }

  clear(): void {
    this.open.clear();
  }
}
