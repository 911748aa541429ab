import { Vector3 } from "three";
import { fittingDistance } from "../lib/framing.ts";
import type { CameraPose } from "../state/view.ts";
import { Gaze } from "./Gaze.ts";
import type { Input } from "./input.ts";
import { clamp, directionOf, easing, FOV, headingOf, lookFromTo } from "./rig.ts";
import type { Eye, Rig, Surroundings } from "./rig.ts";

const TURN = 0.0052;
const DAMPING_S = 0.07;
const NEAREST_M = 0.25;
const FARTHEST_M = 3000;
const ABOVE_GROUND_M = 0.25;

/** Around a point: the selected UAV until one moves on. */
export class Orbit implements Rig {
  private readonly target = new Vector3();
  private readonly shownTarget = new Vector3();
  private readonly gaze = new Gaze(0.7, -0.35);
  private distance = 12;
  private shown = { yaw: 0.7, pitch: -0.35, distance: 12 };
  private follows = true;
  private isPlaced = false;
  private readonly step = new Vector3();
  /** From the UAV that is followed to what the camera looks at: the middle of its group, at first. */
  private readonly offset = new Vector3();
  private followed = "";

  enter(eye: Eye, around: Surroundings, kept: CameraPose | null): void {
    if (kept !== null) {
      this.target.set(kept.x, kept.y, kept.z);
      this.gaze.set(kept);
      this.distance = clamp(NEAREST_M, kept.distance, FARTHEST_M);
      this.follows = kept.follows;
      this.isPlaced = true;
      this.settle();
      return;
    }
    if (this.isPlaced && around.uav !== null) {
      const { yaw } = headingOf(eye.quaternion);
      this.gaze.yaw = yaw;
    }
    this.begin(around);
  }

  /** Around the selected UAV and those near it. */
  private begin(around: Surroundings): void {
    this.follows = true;
    if (around.uav === null) {
      this.target.set(0, 0, around.heightAt(0, 0) + 1);
      return;
    }
    this.isPlaced = true;
    const { uav, group, aspect } = around;
    this.followed = uav.name;
    this.target.fromArray(group.middle);
    this.offset.copy(this.target).sub(uav.position);
    this.gaze.pitch = -0.3;
    this.distance = clamp(14 * uav.radius, fittingDistance(group.radius, FOV, aspect), 120);
    this.settle();
  }

  private settle(): void {
    this.shownTarget.copy(this.target);
    const { yaw, pitch } = this.gaze;
    this.shown = { yaw, pitch, distance: this.distance };
  }

  focus(around: Surroundings): void {
    if (around.uav === null) return;
    this.follows = true;
    this.offset.set(0, 0, 0);
    this.distance = clamp(9 * around.uav.radius, this.distance, 16 * around.uav.radius);
  }

  update(input: Input, around: Surroundings, stepS: number, eye: Eye): void {
    if (!this.isPlaced && around.uav !== null) this.begin(around);
    this.gaze.turn(input, -TURN);
    this.distance = clamp(NEAREST_M, this.distance * input.zoom, FARTHEST_M);
    if (input.panX !== 0 || input.panY !== 0) this.pan(input, eye);
    if (this.follows && around.uav !== null) this.follow(around.uav);
    this.ease(stepS);
    directionOf(this.shown.yaw, this.shown.pitch, this.step);
    eye.position.copy(this.shownTarget).addScaledVector(this.step, -this.shown.distance);
    const ground = around.heightAt(eye.position.x, eye.position.y) + ABOVE_GROUND_M;
    eye.position.z = Math.max(eye.position.z, ground);
    lookFromTo(eye.position, this.shownTarget, eye.quaternion);
    eye.fov = FOV;
  }

  /** Another UAV is looked at itself, not the middle of its group. */
  private follow({ name, position }: NonNullable<Surroundings["uav"]>): void {
    if (name !== this.followed) this.offset.set(0, 0, 0);
    this.followed = name;
    this.target.copy(position).add(this.offset);
  }

  private ease(stepS: number): void {
    const share = easing(stepS, DAMPING_S);
    const { shown } = this;
    shown.yaw += share * (this.gaze.yaw - shown.yaw);
    shown.pitch += share * (this.gaze.pitch - shown.pitch);
    shown.distance *= (this.distance / shown.distance) ** share;
    // What is followed is as smooth as its messages; only leaps need easing.
    const gap = this.shownTarget.distanceTo(this.target);
    if (this.follows && gap < 0.02 * this.distance + 0.1) this.shownTarget.copy(this.target);
    else this.shownTarget.lerp(this.target, share);
  }

  private pan({ panX, panY }: Input, { quaternion }: Eye): void {
    this.follows = false;
    const scale = 0.0011 * this.distance;
    this.target.add(this.step.set(-panX * scale, panY * scale, 0).applyQuaternion(quaternion));
  }

  pose(): CameraPose {
    const { x, y, z } = this.target;
    const { distance, follows } = this;
    const { yaw, pitch } = this.gaze;
    return { x, y, z, yaw, pitch, distance, follows };
  }
}
