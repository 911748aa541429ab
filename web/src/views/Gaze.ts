import type { Quaternion, Vector3 } from "three";
import type { CameraPose } from "../state/view.ts";
import type { Input } from "./input.ts";
import { clamp, directionOf, lookAlong, STEEPEST } from "./rig.ts";

/** Heading and pitch of a view, rad, which dragging turns within limits of the pitch. */
export class Gaze {
  constructor(
    public yaw = 0,
    public pitch = 0,
    private readonly minPitch = -STEEPEST,
    private readonly maxPitch = STEEPEST,
  ) {}

  set({ yaw, pitch }: { yaw: number; pitch: number }): void {
    this.yaw = yaw;
    this.pitch = clamp(this.minPitch, pitch, this.maxPitch);
  }

  /** Turns by `rate` rad a pixel; negative where the scene turns instead of the eye. */
  turn({ turnX, turnY }: Input, rate: number): void {
    this.set({ yaw: this.yaw + rate * turnX, pitch: this.pitch + rate * turnY });
  }

  /** Unit vector of the gaze. */
  direction(out: Vector3): Vector3 {
    return directionOf(this.yaw, this.pitch, out);
  }

  /** Lets a camera look along the gaze. */
  aim(out: Quaternion): void {
    lookAlong(this.yaw, this.pitch, out);
  }

  /** The camera pose of a view that follows nothing. */
  poseAt(x: number, y: number, z: number): CameraPose {
    return { x, y, z, yaw: this.yaw, pitch: this.pitch, distance: 0, follows: false };
  }

  /** East and north parts of a push forward and to the left, seen from above. */
  level(forward: number, left: number): [east: number, north: number] {
    const [c, s] = [Math.cos(this.yaw), Math.sin(this.yaw)];
    return [forward * c - left * s, forward * s + left * c];
  }
}
