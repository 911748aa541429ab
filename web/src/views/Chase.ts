import { Vector3 } from "three";
import type { CameraPose } from "../state/view.ts";
import { Gaze } from "./Gaze.ts";
import type { Input } from "./input.ts";
import { clamp, directionOf, easing, FOV, lookFromTo } from "./rig.ts";
import type { Eye, Rig, Surroundings } from "./rig.ts";

const TURN = 0.005;
const HEADING_S = 0.35;
const PITCH = -0.28;

/** Behind the selected UAV and a little above, turning with its heading. */
export class Chase implements Rig {
  private heading: number | null = null;
  /** Relative to the heading. */
  private readonly gaze = new Gaze(0, PITCH, -1.5, 0.6);
  private away = 1;
  private readonly direction = new Vector3();
  private readonly nose = new Vector3();

  enter(_eye: Eye, _around: Surroundings, kept: CameraPose | null): void {
    this.heading = null;
    this.gaze.set(kept ?? { yaw: 0, pitch: PITCH });
    this.away = kept !== null && kept.distance > 0 ? kept.distance : 1;
  }

  focus(): void {
    this.gaze.set({ yaw: 0, pitch: PITCH });
  }

  update(input: Input, around: Surroundings, stepS: number, eye: Eye): void {
    this.gaze.turn(input, -TURN);
    this.away = clamp(0.3, this.away * input.zoom, 20);
    const { uav } = around;
    if (uav === null) return; // the view stays as it was
    this.nose.set(1, 0, 0).applyQuaternion(uav.quaternion);
    const yaw = Math.atan2(this.nose.y, this.nose.x);
    this.heading ??= yaw;
    this.heading += easing(stepS, HEADING_S) * turnTo(this.heading, yaw);
    directionOf(this.heading + this.gaze.yaw, this.gaze.pitch, this.direction);
    const distance = 7.5 * uav.radius * this.away;
    eye.position.copy(uav.position).addScaledVector(this.direction, -distance);
    const ground = around.heightAt(eye.position.x, eye.position.y);
    eye.position.z = Math.max(eye.position.z, ground + 0.3);
    lookFromTo(eye.position, uav.position, eye.quaternion);
    eye.fov = FOV + 8;
  }

  pose(): CameraPose {
    return {
      x: 0,
      y: 0,
      z: 0,
      yaw: this.gaze.yaw,
      pitch: this.gaze.pitch,
      distance: this.away,
      follows: true,
    };
  }
}

/** The smaller turn from one heading to another. */
function turnTo(from: number, to: number): number {
  const turn = (to - from) % (2 * Math.PI);
  if (turn > Math.PI) return turn - 2 * Math.PI;
  return turn < -Math.PI ? turn + 2 * Math.PI : turn;
}
