import { Quaternion, Vector3 } from "three";
import type { Eye } from "./rig.ts";

/** How long one view turns into another, s. */
export const BLEND_S = 0.5;

/** The transition from one eye to another that may move meanwhile. */
export class Blend {
  private readonly from: Eye = { position: new Vector3(), quaternion: new Quaternion(), fov: 0 };
  private doneS = BLEND_S;

  get running(): boolean {
    return this.doneS < BLEND_S;
  }

  begin(from: Eye): void {
    this.from.position.copy(from.position);
    this.from.quaternion.copy(from.quaternion);
    this.from.fov = from.fov;
    this.doneS = 0;
  }

  /** Change `eye` into what is seen in between. */
  apply(eye: Eye, stepS: number): void {
    if (!this.running) return;
    this.doneS += stepS;
    const t = Math.min(1, this.doneS / BLEND_S);
    const share = t * t * (3 - 2 * t);
    eye.position.lerpVectors(this.from.position, eye.position, share);
    const { quaternion } = this.from;
    eye.quaternion.slerpQuaternions(quaternion, eye.quaternion.clone(), share);
    eye.fov = this.from.fov + share * (eye.fov - this.from.fov);
  }
}
