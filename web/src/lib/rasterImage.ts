// Raw images (sensor_msgs/Image) as pixels of a canvas.

import { labelColour, TURBO_TABLE } from "./colourMaps.ts";
import { ownEntry } from "./ownEntry.ts";

export interface RawImage {
  width: number;
  height: number;
  encoding: string;
  is_bigendian: number | boolean;
  /** Bytes a row. */
  step: number;
  data: Uint8Array;
}

export interface Pixels {
  width: number;
  height: number;
  rgba: Uint8ClampedArray<ArrayBuffer>;
  /** Nearest and farthest that the colours show, m; null: it shows no distances. */
  range: [number, number] | null;
}

/** Channels of 8 bits: where red, green, blue and alpha stand. */
const BYTES: Readonly<Record<string, readonly [number, number, number, number, number]>> = {
  rgb8: [3, 0, 1, 2, -1],
  bgr8: [3, 2, 1, 0, -1],
  rgba8: [4, 0, 1, 2, 3],
  bgra8: [4, 2, 1, 0, 3],
  mono8: [1, 0, 0, 0, -1],
  "8UC1": [1, 0, 0, 0, -1],
  "8UC3": [3, 2, 1, 0, -1],
};

/** What no colour is known for. */
const UNKNOWN = [40, 40, 46, 255] as const;

/** Throws with the reason when an encoding is not known or bytes are missing. */
export function pixelsOf(image: RawImage, topic = ""): Pixels {
  const { encoding, width, height } = image;
  if (image.data.byteLength < image.step * height) {
    throw new Error(`the data of the ${width} x ${height} ${encoding} image is too short`);
  }
  if (/label/.test(topic)) return labelled(image);
  const channels = ownEntry(BYTES, encoding);
  if (channels !== undefined) return coloured(image, channels);
  if (encoding === "32FC1" || encoding === "16UC1") return ofDepth(image);
  if (encoding === "mono16") return grey(image);
  if (encoding === "32SC1") return labelled(image);
  throw new Error(`unsupported encoding: ${encoding}`);
}

function coloured(image: RawImage, [bytes, r, g, b, a]: readonly number[]): Pixels {
  const { width, height, step, data } = image;
  const rgba = new Uint8ClampedArray(width * height * 4);
  let to = 0;
  for (let row = 0; row < height; row++) {
    for (let column = 0; column < width; column++, to += 4) {
      const from = row * step + column * bytes!;
      rgba[to] = data[from + r!]!;
      rgba[to + 1] = data[from + g!]!;
      rgba[to + 2] = data[from + b!]!;
      rgba[to + 3] = a! < 0 ? 255 : data[from + a!]!;
    }
  }
  return { width, height, rgba, range: null };
}

/** Metres as colours from the nearest to the farthest that is seen. */
function ofDepth(image: RawImage): Pixels {
  const depths = numbersOf(image);
  if (image.encoding === "16UC1") depths.forEach((mm, i) => (depths[i] = mm > 0 ? mm / 1000 : NaN));
  const range = rangeOf(depths);
  const scale = 255 / Math.max(1e-6, range[1] - range[0]);
  const rgba = painted(image, (i, to, into) => {
    const depth = depths[i]!;
    // Near is red, which matters most in flight.
    const row = Math.round(255 - (depth - range[0]) * scale);
    if (Number.isFinite(depth)) {
      const from = Math.max(0, Math.min(255, row)) * 4;
      for (let k = 0; k < 4; k++) into[to + k] = TURBO_TABLE[from + k]!;
    } else into.set(UNKNOWN, to);
  });
  return { width: image.width, height: image.height, rgba, range };
}

function grey(image: RawImage): Pixels {
  const values = numbersOf(image);
  const rgba = painted(image, (i, to, into) => {
    into.fill(values[i]! / 257, to, to + 3);
    into[to + 3] = 255;
  });
  return { width: image.width, height: image.height, rgba, range: null };
}

function labelled(image: RawImage): Pixels {
  const labels = numbersOf(image);
  const known = new Map<number, readonly [number, number, number]>();
  const rgba = painted(image, (i, to, into) => {
    const label = labels[i]!;
    let colour = known.get(label);
    if (colour === undefined) known.set(label, (colour = labelColour(label)));
    into.set(colour, to);
    into[to + 3] = 255;
  });
  return { width: image.width, height: image.height, rgba, range: null };
}

function painted(
  { width, height }: RawImage,
  paint: (i: number, to: number, into: Uint8ClampedArray) => void,
): Uint8ClampedArray<ArrayBuffer> {
  const rgba = new Uint8ClampedArray(width * height * 4);
  for (let i = 0; i < width * height; i++) paint(i, i * 4, rgba);
  return rgba;
}

/** One number a pixel, row by row. */
function numbersOf(image: RawImage): Float32Array {
  const { width, height, step, data, encoding, is_bigendian } = image;
  const view = new DataView(data.buffer, data.byteOffset, data.byteLength);
  const little = !is_bigendian;
  const read: Record<string, [number, (at: number) => number]> = {
    "32FC1": [4, (at) => view.getFloat32(at, little)],
    "32SC1": [4, (at) => view.getInt32(at, little)],
    "16UC1": [2, (at) => view.getUint16(at, little)],
    mono16: [2, (at) => view.getUint16(at, little)],
    mono8: [1, (at) => view.getUint8(at)],
    "8UC1": [1, (at) => view.getUint8(at)],
  };
  const reader = ownEntry(read, encoding);
  if (reader === undefined) throw new Error(`unsupported encoding: ${encoding}`);
  const [bytes, at] = reader;
  const numbers = new Float32Array(width * height);
  for (let row = 0, i = 0; row < height; row++) {
    for (let column = 0; column < width; column++, i++)
      numbers[i] = at(row * step + column * bytes);
  }
  return numbers;
}

/** Minimum and maximum of the finite numbers. */
function rangeOf(numbers: Float32Array): [number, number] {
  let [min, max] = [Infinity, -Infinity];
  for (const number of numbers) {
    if (!Number.isFinite(number)) continue;
    if (number < min) min = number;
    if (number > max) max = number;
  }
  return min <= max ? [min, max] : [0, 0];
}
