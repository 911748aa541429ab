import { Quaternion, Vector3 } from "three";
import { link } from "../../link/link.ts";

/** A camera as its `camera_info` describes it. */
export interface CameraModel {
  topic: string;
  frame: string;
  width: number;
  height: number;
  fx: number;
  fy: number;
  cx: number;
  cy: number;
}

/** All cameras whose info was received, by topic. */
export const cameras = new Map<string, CameraModel>();

/** Optical frames look along z with y down; three's cameras along -z with y up. */
const FLIP = new Quaternion(1, 0, 0, 0);

/** Where the front camera of a UAV is and looks; false: it has none. */
export function cameraOfUav(
  uav: string,
  out: { position: Vector3; quaternion: Quaternion; fov: number },
): boolean {
  for (const camera of cameras.values()) {
    if (!camera.frame.startsWith(`${uav}/`)) continue;
    const pose = link.frames.pose(camera.frame);
    if (pose === null) continue;
    const forward = looksAhead(camera.frame);
    if (!forward) continue;
    out.position.set(pose[0], pose[1], pose[2]);
    out.quaternion.set(pose[3], pose[4], pose[5], pose[6]).multiply(FLIP);
    out.fov = (2 * Math.atan((0.5 * camera.height) / camera.fy) * 180) / Math.PI;
    return true;
  }
  return false;
}

const axis = new Vector3();
const turn = new Quaternion();

/** Whether a camera looks rather forward than down. */
function looksAhead(frame: string): boolean {
  const mount = link.frames.mount(frame);
  if (mount === null) return false;
  const [, , , x, y, z, w] = mount.pose;
  return axis.set(0, 0, 1).applyQuaternion(turn.set(x, y, z, w)).x > 0.5;
}
