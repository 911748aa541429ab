import { rotate, type Pose } from "../../lib/pose.ts";

/** A place given in a frame, in the map. */
export function toMap(
  [px, py, pz, qx, qy, qz, qw]: Readonly<Pose>,
  x: number,
  y: number,
  z: number,
): [number, number, number] {
  const [rx, ry, rz] = rotate(qx, qy, qz, qw, x, y, z);
  return [px + rx, py + ry, pz + rz];
}
