import { rotate, type Pose } from "../../lib/pose.ts";

/** Returns a position in the map that is given in a frame. */
export function toMap(
  [px, py, pz, qx, qy, qz, qw]: Readonly<Pose>,
  x: number,
  y: number,
  z: number,
): [number, number, number] {
  const [rx, ry, rz] = rotate(qx, qy, qz, qw, x, y, z);
  return [px + rx, py + ry, pz + rz];
}
