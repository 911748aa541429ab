import { Vector3, type PerspectiveCamera } from "three";
import { POSE } from "../../link/protocol.ts";
import { fleet } from "../uavs/fleet.ts";
import { shown } from "./shown.ts";

/** A click so close to a UAV's middle means it, CSS pixels; a large one has more. */
const CLOSE_PX = 16;
const BODY_M = 0.35;

const point = new Vector3();

/** Name of the UAV at a pixel of the view; empty: none. */
export function pickUav(
  x: number,
  y: number,
  camera: PerspectiveCamera,
  { width, height }: { width: number; height: number },
): string {
  const scale = height / (2 * Math.tan((camera.fov * Math.PI) / 360));
  let best = Infinity;
  let name = "";
  for (const uav of fleet.uavs) {
    const at = uav.row * POSE;
    if (at < 0) continue;
    point.fromArray(shown.poses, at);
    const away = point.distanceTo(camera.position);
    point.project(camera);
    if (!(Math.abs(point.z) < 1)) continue;
    const px = Math.hypot((0.5 + 0.5 * point.x) * width - x, (0.5 - 0.5 * point.y) * height - y);
    const radiusPx = Math.max(CLOSE_PX, (BODY_M * scale) / away);
    if (px > radiusPx || px + 0.05 * away > best) continue;
    best = px + 0.05 * away;
    name = uav.name;
  }
  return name;
}

/** Names of the UAVs whose middle is in a box of the view; two of its corners in CSS pixels. */
export function uavsWithin(
  a: { x: number; y: number },
  b: { x: number; y: number },
  camera: PerspectiveCamera,
  { width, height }: { width: number; height: number },
): string[] {
  const [left, right] = [Math.min(a.x, b.x), Math.max(a.x, b.x)];
  const [top, bottom] = [Math.min(a.y, b.y), Math.max(a.y, b.y)];
  const names: string[] = [];
  for (const { name, row } of fleet.uavs) {
    if (row < 0) continue;
    point.fromArray(shown.poses, row * POSE).project(camera);
    if (!(Math.abs(point.z) < 1)) continue;
    const [x, y] = [(0.5 + 0.5 * point.x) * width, (0.5 - 0.5 * point.y) * height];
    if (x >= left && x <= right && y >= top && y <= bottom) names.push(name);
  }
  return names;
}
