// Returns of range sensors as numbers: x y z in the sensor's frame, three a return.

import type { sensor_msgs_LaserScan, sensor_msgs_PointCloud2 } from "../../messages/generated.ts";

const FLOAT32 = 7;
const FLOAT64 = 8;

/** Returns of a level scanner: what lies within its range. */
export function pointsOfScan(scan: sensor_msgs_LaserScan, maxPoints: number): Float32Array {
  const { ranges, angle_min, angle_increment, range_min, range_max } = scan;
  const stride = Math.max(1, Math.ceil(ranges.length / Math.max(1, maxPoints)));
  const out = new Float32Array(3 * Math.ceil(ranges.length / stride));
  let count = 0;
  for (let i = 0; i < ranges.length; i += stride) {
    const range = ranges[i]!;
    if (!(range >= range_min && range < range_max)) continue; // also null and NaN
    const angle = angle_min + i * angle_increment;
    out[count++] = range * Math.cos(angle);
    out[count++] = range * Math.sin(angle);
    out[count++] = 0;
  }
  return out.subarray(0, count);
}

/** Points of a cloud with fields x, y, z of floating point; empty where it has none. */
export function pointsOfCloud(cloud: sensor_msgs_PointCloud2, maxPoints: number): Float32Array {
  const bytes = bytesOf(cloud.data);
  const readers = ["x", "y", "z"].map((name) => reader(cloud, name, bytes));
  const [x, y, z] = readers;
  if (x == null || y == null || z == null || !(cloud.point_step > 0)) return new Float32Array(0);
  const begin = pointBegin(cloud);
  let total = cloud.width * cloud.height;
  if (begin(total - 1) + cloud.point_step > bytes.byteLength) {
    total = wholePoints(cloud, bytes.byteLength); // a message that was cut
  }
  const stride = Math.max(1, Math.ceil(total / Math.max(1, maxPoints)));
  const out = new Float32Array(3 * Math.ceil(total / stride));
  let count = 0;
  for (let i = 0; i < total; i += stride) {
    const at = begin(i);
    const [px, py, pz] = [x(at), y(at), z(at)];
    if (!Number.isFinite(px + py + pz)) continue;
    out[count++] = px;
    out[count++] = py;
    out[count++] = pz;
  }
  return out.subarray(0, count);
}

/** Length of a row in bytes: rows may be padded; a length that is too short counts as none. */
function rowStep({ width, point_step, row_step }: sensor_msgs_PointCloud2): number {
  return Math.max(width * point_step, row_step);
}

/** The byte at which a point begins, by its number. */
function pointBegin(cloud: sensor_msgs_PointCloud2): (i: number) => number {
  const { width, point_step } = cloud;
  const row = rowStep(cloud);
  if (row === width * point_step) return (i) => i * point_step;
  return (i) => Math.floor(i / width) * row + (i % width) * point_step;
}

/** Number of points that lie within so many bytes. */
function wholePoints(cloud: sensor_msgs_PointCloud2, length: number): number {
  const { width, height, point_step } = cloud;
  const row = rowStep(cloud);
  if (!(row > 0)) return 0;
  const rows = Math.floor(length / row);
  const inLast = Math.min(width, Math.floor((length - rows * row) / point_step));
  return Math.min(width * height, rows * width + inLast);
}

/** How to read a field of the point that begins at a byte; null: it cannot be read. */
function reader(
  { fields, is_bigendian, point_step }: sensor_msgs_PointCloud2,
  name: string,
  bytes: Uint8Array,
): ((at: number) => number) | null {
  const field = fields.find((field) => field.name === name);
  if (field === undefined) return null;
  const { offset, datatype } = field;
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const size = datatype === FLOAT64 ? 8 : 4;
  if (offset + size > point_step) return null;
  if (datatype === FLOAT32) return (at) => view.getFloat32(at + offset, !is_bigendian);
  if (datatype === FLOAT64) return (at) => view.getFloat64(at + offset, !is_bigendian);
  return null;
}

/** Bytes as CBOR brings them, or base64 as JSON does. */
export function bytesOf(data: Uint8Array | string | number[]): Uint8Array {
  if (data instanceof Uint8Array) return data;
  if (typeof data !== "string") return Uint8Array.from(data);
  const text = atob(data);
  return Uint8Array.from(text, (letter) => letter.charCodeAt(0));
}
