import { Vector3 } from "three";
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
  wayOf,
  type Eye,
  type Rig,
  type Surroundings,
} from "./rig.ts";

const TURN = 0.0034;
const SPEED_M_S = 8;
const FAST = 5;
const INERTIA_S = 0.12;

/** Free, through everything but the ground. */
export class Fly implements Rig {
  private readonly position = new Vector3();
  private readonly velocity = new Vector3();
  private readonly wanted = new Vector3();
  private readonly way = new Vector3();
  private yaw = 0;
  private pitch = 0;
  private pace = 1;

  enter(eye: Eye, _around: Surroundings, kept: CameraPose | null): void {
    this.velocity.set(0, 0, 0);
    if (kept === null) {
      this.position.copy(eye.position);
      Object.assign(this, headingOf(eye.quaternion));
      return;
    }
    this.position.set(kept.x, kept.y, kept.z);
    this.yaw = kept.yaw;
    this.pitch = kept.pitch;
  }

  update(input: Input, around: Surroundings, stepS: number, eye: Eye): void {
    this.yaw += TURN * input.turnX;
    this.pitch = clamp(-STEEPEST, this.pitch + TURN * input.turnY, STEEPEST);
    this.pace = clamp(0.1, this.pace / input.zoom, 20);
    const [ahead, left, up] = pushed(input.held);
    const speed = SPEED_M_S * this.pace * (isFast(input.held) ? FAST : 1);
    wayOf(this.yaw, this.pitch, this.wanted).multiplyScalar(ahead);
    this.wanted.x -= left * Math.sin(this.yaw);
    this.wanted.y += left * Math.cos(this.yaw);
    this.wanted.z += up;
    this.velocity.lerp(this.wanted.multiplyScalar(speed), easing(stepS, INERTIA_S));
    this.position.addScaledVector(this.velocity, stepS);
    this.drag(input);
    const ground = around.heightAt(this.position.x, this.position.y) + 0.3;
    this.position.z = Math.max(this.position.z, ground);
    eye.position.copy(this.position);
    lookAlong(this.yaw, this.pitch, eye.quaternion);
    eye.fov = FOV;
  }

  /** Two fingers or the right button push the picture. */
  private drag({ panX, panY }: Input): void {
    const scale = 0.02 * this.pace;
    this.position.x += scale * panX * Math.sin(this.yaw);
    this.position.y -= scale * panX * Math.cos(this.yaw);
    this.position.addScaledVector(wayOf(this.yaw, this.pitch, this.way), scale * panY);
  }

  pose(): CameraPose {
    const { x, y, z } = this.position;
    return { x, y, z, yaw: this.yaw, pitch: this.pitch, distance: 0, follows: false };
  }
}
