import type { CameraPose } from "../state/view.ts";
import type { Input } from "./input.ts";
import {
  clamp,
  easing,
  FOV,
  headingOf,
  isFast,
  lookAlong,
  pushed,
  STEEPEST,
  type Eye,
  type Rig,
  type Surroundings,
} from "./rig.ts";

const TURN = 0.0034;
const EYES_M = 1.7;
/** A brisk walk, and a run. */
const SPEED_M_S = 1.9;
const RUN = 3;
/** Begins so far from the selected UAV, m. */
const AWAY_M = 7;

/** A pedestrian: on the ground, stopped by trunks and walls. */
export class Walk implements Rig {
  private x = 0;
  private y = 0;
  private eyesZ: number | null = null;
  private yaw = 0;
  private pitch = 0;
  private readonly velocity: [number, number] = [0, 0];

  enter(eye: Eye, around: Surroundings, kept: CameraPose | null): void {
    this.velocity.fill(0);
    this.eyesZ = null;
    if (kept !== null) {
      this.x = kept.x;
      this.y = kept.y;
      this.yaw = kept.yaw;
      this.pitch = kept.pitch;
      return;
    }
    const { yaw } = headingOf(eye.quaternion);
    this.yaw = yaw;
    this.pitch = 0;
    const { uav } = around;
    const high = eye.position.z - around.heightAt(eye.position.x, eye.position.y) > 3 * EYES_M;
    if (uav !== null && high) this.standBefore(uav.position, around);
    else [this.x, this.y] = [eye.position.x, eye.position.y];
    [this.x, this.y] = around.walk([this.x, this.y], [this.x, this.y]);
  }

  /** Near the selected UAV and looking at it. */
  private standBefore(at: { x: number; y: number; z: number }, around: Surroundings): void {
    this.x = at.x - AWAY_M * Math.cos(this.yaw);
    this.y = at.y - AWAY_M * Math.sin(this.yaw);
    const eyes = around.heightAt(this.x, this.y) + EYES_M;
    this.pitch = clamp(-0.6, Math.atan2(at.z - eyes, AWAY_M), 0.9);
  }

  update(input: Input, around: Surroundings, stepS: number, eye: Eye): void {
    this.yaw += TURN * input.turnX;
    this.pitch = clamp(-STEEPEST, this.pitch + TURN * input.turnY, STEEPEST);
    const [ahead, left] = pushed(input.held);
    const speed = SPEED_M_S * (isFast(input.held) ? RUN : 1);
    const length = Math.max(1, Math.hypot(ahead, left));
    const [c, s] = [Math.cos(this.yaw), Math.sin(this.yaw)];
    const share = easing(stepS, 0.08);
    const wanted = [(ahead * c - left * s) / length, (ahead * s + left * c) / length] as const;
    for (const i of [0, 1] as const)
      this.velocity[i] += share * (wanted[i] * speed - this.velocity[i]);
    const push = 0.01;
    const toX = this.x + this.velocity[0] * stepS + push * (input.panY * c + input.panX * s);
    const toY = this.y + this.velocity[1] * stepS + push * (input.panY * s - input.panX * c);
    [this.x, this.y] = around.walk([this.x, this.y], [toX, toY]);
    const eyes = around.heightAt(this.x, this.y) + EYES_M;
    this.eyesZ ??= eyes;
    this.eyesZ += easing(stepS, 0.1) * (eyes - this.eyesZ); // steps are not felt at once
    eye.position.set(this.x, this.y, this.eyesZ);
    lookAlong(this.yaw, this.pitch, eye.quaternion);
    eye.fov = FOV + 10;
  }

  pose(): CameraPose {
    const { x, y, yaw, pitch } = this;
    return { x, y, z: this.eyesZ ?? 0, yaw, pitch, distance: 0, follows: false };
  }
}
