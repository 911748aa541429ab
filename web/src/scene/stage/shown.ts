import type { Frames } from "../../link/frames.ts";
import { POSE } from "../../link/protocol.ts";

const SHORTEST_MS = 4;
const LONGEST_MS = 400;
/** A step farther than this, and faster than that, was a leap: a teleport. */
const LEAP_M = 1.5;
const LEAP_M_S = 60;

/**
 * The poses that the scene shows: moving from where they were shown when the newest message came to
 * what it said, in the time that messages take to follow each other. They arrive when the
 * next one is due, stand still when it is late, and never run ahead of what is known.
 */
export class ShownPoses {
  /** Rows of x y z qx qy qz qw, as in `frames.names`; NaN: not known. */
  poses = new Float64Array(0);
  /** Grows when the rows have other names. */
  version = -1;

  /** Whether anything has moved with the last update. */
  moved = false;

  private from = new Float64Array(0);
  private to = new Float64Array(0);
  private arrivedMs = 0;
  private periodMs = 33;

  update(frames: Frames, nowMs: number): void {
    this.moved = false;
    if (frames.version !== this.version || frames.now.length !== this.poses.length)
      this.restart(frames);
    else if (frames.now !== this.to) this.turnTo(frames);
    this.moveOn(nowMs);
  }

  /** Fraction of the motion that is done, 0 to 1. */
  private share(nowMs: number): number {
    return Math.min(1, Math.max(0, (nowMs - this.arrivedMs) / this.periodMs));
  }

  private restart(frames: Frames): void {
    if (frames.now.length !== frames.names.length * POSE) return; // names came, poses follow
    this.version = frames.version;
    this.to = frames.now;
    this.poses = Float64Array.from(this.to);
    this.from = Float64Array.from(this.to);
    this.arrivedMs = frames.arrivedMs;
    this.moved = true;
  }

  private turnTo(frames: Frames): void {
    this.moveOn(frames.arrivedMs); // as far as it has come when the message arrived
    const gapMs = Math.min(LONGEST_MS, Math.max(SHORTEST_MS, frames.arrivedMs - this.arrivedMs));
    this.periodMs += 0.15 * (gapMs - this.periodMs);
    this.arrivedMs = frames.arrivedMs;
    this.from.set(this.poses);
    this.to = frames.now;
    const leap = Math.max(LEAP_M, (LEAP_M_S * gapMs) / 1000);
    for (let at = 0; at < this.to.length; at += POSE) {
      const dx = this.to[at]! - this.from[at]!;
      const dy = this.to[at + 1]! - this.from[at + 1]!;
      const dz = this.to[at + 2]! - this.from[at + 2]!;
      // also where one of the two is not known
      if (!(dx * dx + dy * dy + dz * dz < leap * leap))
        for (let i = at; i < at + POSE; i++) this.from[i] = this.to[i]!;
    }
  }

  private moveOn(nowMs: number): void {
    const share = this.share(nowMs);
    const { from, to, poses } = this;
    if (to.length !== poses.length) return;
    for (let at = 0; at < poses.length; at += POSE) {
      const before = poses[at]! + poses[at + 1]! + poses[at + 2]!;
      for (let i = at; i < at + 3; i++) poses[i] = from[i]! + share * (to[i]! - from[i]!);
      turn(poses, from, to, at + 3, share);
      const now = poses[at]! + poses[at + 1]! + poses[at + 2]!;
      if (Math.abs(now - before) > 1e-5) this.moved = true;
    }
  }
}

/** Quaternion at `at` between those of `from` and `to`: straight on and normalized. */
function turn(
  out: Float64Array,
  from: Float64Array,
  to: Float64Array,
  at: number,
  share: number,
): void {
  let dot = 0;
  for (let i = at; i < at + 4; i++) dot += from[i]! * to[i]!;
  const far = dot < 0 ? -share : share;
  let square = 0;
  for (let i = at; i < at + 4; i++) {
    out[i] = (1 - share) * from[i]! + far * to[i]!;
    square += out[i]! * out[i]!;
  }
  const scale = square > 1e-12 ? 1 / Math.sqrt(square) : NaN;
  for (let i = at; i < at + 4; i++) out[i]! *= scale;
}

/** Those of the page's one scene. */
export const shown = new ShownPoses();
