// Poses as matrices, written straight into the buffers of instanced meshes.

/** Rotation matrix of a quaternion at `at` of `poses` (after x y z), row by row into `out`. */
export function rotationOf(poses: ArrayLike<number>, at: number, out: Float64Array): void {
  const x = poses[at + 3]!;
  const y = poses[at + 4]!;
  const z = poses[at + 5]!;
  const w = poses[at + 6]!;
  out[0] = 1 - 2 * (y * y + z * z);
  out[1] = 2 * (x * y - z * w);
  out[2] = 2 * (x * z + y * w);
  out[3] = 2 * (x * y + z * w);
  out[4] = 1 - 2 * (x * x + z * z);
  out[5] = 2 * (y * z - x * w);
  out[6] = 2 * (x * z - y * w);
  out[7] = 2 * (y * z + x * w);
  out[8] = 1 - 2 * (x * x + y * y);
}

/** Matrix number `i` of an instanced mesh: rotation (row by row), scale, position. */
export function putMatrix(
  array: Float32Array | Float64Array | ArrayLike<number>,
  i: number,
  r: Float64Array,
  scale: number,
  x: number,
  y: number,
  z: number,
): void {
  const m = array as Float32Array;
  const at = 16 * i;
  m[at] = r[0]! * scale;
  m[at + 1] = r[3]! * scale;
  m[at + 2] = r[6]! * scale;
  m[at + 3] = 0;
  m[at + 4] = r[1]! * scale;
  m[at + 5] = r[4]! * scale;
  m[at + 6] = r[7]! * scale;
  m[at + 7] = 0;
  m[at + 8] = r[2]! * scale;
  m[at + 9] = r[5]! * scale;
  m[at + 10] = r[8]! * scale;
  m[at + 11] = 0;
  m[at + 12] = x;
  m[at + 13] = y;
  m[at + 14] = z;
  m[at + 15] = 1;
}

/** Product of two rotations. */
export function product(a: Float64Array, b: Float64Array, out: Float64Array): void {
  for (let i = 0; i < 3; i++)
    for (let j = 0; j < 3; j++)
      out[3 * i + j] = a[3 * i]! * b[j]! + a[3 * i + 1]! * b[3 + j]! + a[3 * i + 2]! * b[6 + j]!;
}

/** A vector given in a rotated frame, in the outer frame. */
export function rotated(
  r: Float64Array,
  v: ArrayLike<number>,
  at: number,
  out: Float64Array,
): void {
  const x = v[at]!;
  const y = v[at + 1]!;
  const z = v[at + 2]!;
  out[0] = r[0]! * x + r[1]! * y + r[2]! * z;
  out[1] = r[3]! * x + r[4]! * y + r[5]! * z;
  out[2] = r[6]! * x + r[7]! * y + r[8]! * z;
}
