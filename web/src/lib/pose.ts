/** x y z qx qy qz qw; m. */
export type Pose = [number, number, number, number, number, number, number];

export function identity(): Pose {
  return [0, 0, 0, 0, 0, 0, 1];
}

/** Pose of C in A from those of B in A and of C in B. */
export function compose(ab: Readonly<Pose>, bc: Readonly<Pose>): Pose {
  const [x, y, z, ax, ay, az, aw] = ab;
  const [px, py, pz, bx, by, bz, bw] = bc;
  const [rx, ry, rz] = rotate(ax, ay, az, aw, px, py, pz);
  return [
    x + rx,
    y + ry,
    z + rz,
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

/** A vector turned by a unit quaternion. */
export function rotate(
  qx: number,
  qy: number,
  qz: number,
  qw: number,
  x: number,
  y: number,
  z: number,
): [number, number, number] {
  const tx = 2 * (qy * z - qz * y);
  const ty = 2 * (qz * x - qx * z);
  const tz = 2 * (qx * y - qy * x);
  return [
    x + qw * tx + qy * tz - qz * ty,
    y + qw * ty + qz * tx - qx * tz,
    z + qw * tz + qx * ty - qy * tx,
  ];
}

/** Heading, roll and pitch of a unit quaternion, rad (REP-103). */
export function eulerOf(qx: number, qy: number, qz: number, qw: number) {
  return {
    roll: Math.atan2(2 * (qw * qx + qy * qz), 1 - 2 * (qx * qx + qy * qy)),
    pitch: Math.asin(Math.max(-1, Math.min(1, 2 * (qw * qy - qz * qx)))),
    yaw: Math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz)),
  };
}
