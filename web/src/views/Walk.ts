import type { CameraPose } from "../state/view.ts";
import { Gaze } from "./Gaze.ts";
import type { Input } from "./input.ts";
import { clamp, easing, FOV, headingOf, isFast, pushed } from "./rig.ts";
import type { Eye, Rig, Surroundings } from "./rig.ts";

const TURN = 0.0034;
const EYES_M = 1.7;
/** A brisk walk, and a run. */
const SPEED_M_S = 1.9;
const RUN = 3;
/** A step for a pixel of dragging, m. */
const PUSH_M = 0.01;
/** Begins so far from the selected UAV, m. */
const AWAY_M = 7;

/** A pedestrian: on the ground, stopped by trunks and walls. */
export class Walk implements Rig {
  private x = 0;
  private y = 0;
  private eyesZ: number | null = null;
  private readonly gaze = new Gaze();
  private readonly velocity: [number, number] = [0, 0];

  enter(eye: Eye, around: Surroundings, kept: CameraPose | null): void {
    this.velocity.fill(0);
    this.eyesZ = null;
    if (kept !== null) {
      this.x = kept.x;
      this.y = kept.y;
      this.gaze.set(kept);
      return;
    }
    const { yaw } = headingOf(eye.quaternion);
    this.gaze.set({ yaw, pitch: 0 });
    const { uav } = around;
    const high = eye.position.z - around.heightAt(eye.position.x, eye.position.y) > 3 * EYES_M;
    if (uav !== null && high) this.standBefore(uav.position, around);
    else [this.x, this.y] = [eye.position.x, eye.position.y];
    [this.x, this.y] = around.walk([this.x, this.y], [this.x, this.y]);
  }

  /** Near the selected UAV and looking at it. */
  private standBefore(at: { x: number; y: number; z: number }, around: Surroundings): void {
    const [east, north] = this.gaze.level(AWAY_M, 0);
    [this.x, this.y] = [at.x - east, at.y - north];
    const eyes = around.heightAt(this.x, this.y) + EYES_M;
    this.gaze.pitch = clamp(-0.6, Math.atan2(at.z - eyes, AWAY_M), 0.9);
  }

  update(input: Input, around: Surroundings, stepS: number, eye: Eye): void {
    this.gaze.turn(input, TURN);
    const [forward, left] = pushed(input.held);
    const speed = SPEED_M_S * (isFast(input.held) ? RUN : 1);
    const length = Math.max(1, Math.hypot(forward, left));
    const share = easing(stepS, 0.08);
    const wanted = this.gaze.level(forward / length, left / length);
    for (const i of [0, 1] as const)
      this.velocity[i] += share * (wanted[i] * speed - this.velocity[i]);
    const [east, north] = this.gaze.level(PUSH_M * input.panY, -PUSH_M * input.panX);
    const to = [
      this.x + this.velocity[0] * stepS + east,
      this.y + this.velocity[1] * stepS + north,
    ] as const;
    [this.x, this.y] = around.walk([this.x, this.y], to);
    const eyes = around.heightAt(this.x, this.y) + EYES_M;
    this.eyesZ ??= eyes;
    this.eyesZ += easing(stepS, 0.1) * (eyes - this.eyesZ); // steps are not felt at once
    eye.position.set(this.x, this.y, this.eyesZ);
    this.gaze.aim(eye.quaternion);
    eye.fov = FOV + 10;
  }

  pose(): CameraPose {
    return this.gaze.poseAt(this.x, this.y, this.eyesZ ?? 0);
  }
}
