import { Vector3 } from "three";
import type { CameraPose } from "../state/view.ts";
import { Gaze } from "./Gaze.ts";
import type { Input } from "./input.ts";
import { clamp, easing, FOV, headingOf, isFast, pushed } from "./rig.ts";
import type { Eye, Rig, Surroundings } from "./rig.ts";

const TURN = 0.0034;
const SPEED_M_S = 8;
const FAST = 5;
const INERTIA_S = 0.12;

/** Free, through everything but the ground. */
export class Fly implements Rig {
  private readonly position = new Vector3();
  private readonly velocity = new Vector3();
  private readonly wanted = new Vector3();
  private readonly direction = new Vector3();
  private readonly gaze = new Gaze();
  private speedFactor = 1;

  enter(eye: Eye, _around: Surroundings, kept: CameraPose | null): void {
    this.velocity.set(0, 0, 0);
    if (kept === null) {
      this.position.copy(eye.position);
      this.gaze.set(headingOf(eye.quaternion));
      return;
    }
    this.position.set(kept.x, kept.y, kept.z);
    this.gaze.set(kept);
  }

  update(input: Input, around: Surroundings, stepS: number, eye: Eye): void {
    this.gaze.turn(input, TURN);
    this.speedFactor = clamp(0.1, this.speedFactor / input.zoom, 20);
    const [forward, left, up] = pushed(input.held);
    const speed = SPEED_M_S * this.speedFactor * (isFast(input.held) ? FAST : 1);
    const [east, north] = this.gaze.level(0, left);
    this.gaze.direction(this.wanted).multiplyScalar(forward);
    this.wanted.x += east;
    this.wanted.y += north;
    this.wanted.z += up;
    this.velocity.lerp(this.wanted.multiplyScalar(speed), easing(stepS, INERTIA_S));
    this.position.addScaledVector(this.velocity, stepS);
    this.drag(input);
    const ground = around.heightAt(this.position.x, this.position.y) + 0.3;
    this.position.z = Math.max(this.position.z, ground);
    eye.position.copy(this.position);
    this.gaze.aim(eye.quaternion);
    eye.fov = FOV;
  }

  /** Two fingers or the right button push the view. */
  private drag({ panX, panY }: Input): void {
    const scale = 0.02 * this.speedFactor;
    const [east, north] = this.gaze.level(0, -panX);
    this.position.x += scale * east;
    this.position.y += scale * north;
    this.position.addScaledVector(this.gaze.direction(this.direction), scale * panY);
  }

  pose(): CameraPose {
    const { x, y, z } = this.position;
    return this.gaze.poseAt(x, y, z);
  }
}
