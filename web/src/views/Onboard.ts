import { Quaternion, Vector3 } from "three";
import type { CameraPose } from "../state/view.ts";
import type { Input } from "./input.ts";
import { clamp, type Eye, type Rig, type Surroundings } from "./rig.ts";

/** Vertical field of view of a UAV without a camera, degrees. */
const NOSE_FOV = 70;

/** A camera looks along -z with y up, a body along x with z up. */
const CAMERA_IN_BODY = new Quaternion(0.5, -0.5, -0.5, 0.5);

/** From the selected UAV's front camera; from its nose where it has none. */
export class Onboard implements Rig {
  private zoom = 1;
  private readonly nose = new Vector3();

  enter(_eye: Eye, _around: Surroundings, _kept: CameraPose | null): void {
    this.zoom = 1;
  }

  update(input: Input, { uav, uavCamera }: Surroundings, _stepS: number, eye: Eye): void {
    this.zoom = clamp(0.2, this.zoom * input.zoom, 1.5);
    if (uavCamera !== null) {
      eye.position.copy(uavCamera.position);
      eye.quaternion.copy(uavCamera.quaternion);
      eye.fov = clamp(5, uavCamera.fov * this.zoom, 120);
      return;
    }
    if (uav === null) return;
    this.nose.set(0.55 * uav.radius, 0, 0.12 * uav.radius).applyQuaternion(uav.quaternion);
    eye.position.copy(uav.position).add(this.nose);
    eye.quaternion.copy(uav.quaternion).multiply(CAMERA_IN_BODY);
    eye.fov = NOSE_FOV * this.zoom;
  }

  pose(): null {
    return null;
  }
}
