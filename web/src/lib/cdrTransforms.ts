// Transforms in CDR, the wire format of ROS 2: those of a thousand UAVs are read in a millisecond,
// and as objects in ten.

const ENCAPSULATION_BYTES = 4;
const LITTLE_ENDIAN = 1;
const POSE = 7;

/** A `tf2_msgs/msg/TFMessage`. */
export interface Transforms {
  /** Stamp of the first one, s; NaN: there is none. */
  stampS: number;
  parents: string[];
  children: string[];
  /** Rows of x y z qx qy qz qw, child in parent. */
  poses: Float64Array;
}

const text = new TextDecoder();

export function readTransforms(bytes: Uint8Array): Transforms {
  const little = bytes[1] === LITTLE_ENDIAN;
  // Alignment counts from the end of the encapsulation's header.
  const body = bytes.subarray(ENCAPSULATION_BYTES);
  const view = new DataView(body.buffer, body.byteOffset, body.byteLength);
  let at = 0;
  const align = (size: number) => (at = Math.ceil(at / size) * size);
  const number = () => {
    align(4);
    at += 4;
    return view.getUint32(at - 4, little);
  };
  const string = () => {
    const length = number();
    at += length;
    return text.decode(body.subarray(at - length, at - 1)); // it ends with a 0
  };
  const count = number();
  const read: Transforms = {
    stampS: NaN,
    parents: [],
    children: [],
    poses: new Float64Array(POSE * count),
  };
  for (let i = 0; i < count; i++) {
    const seconds = number() | 0;
    const nanoseconds = number();
    if (i === 0) read.stampS = seconds + 1e-9 * nanoseconds;
    read.parents.push(string());
    read.children.push(string());
    align(8);
    for (let k = 0; k < POSE; k++, at += 8) read.poses[POSE * i + k] = view.getFloat64(at, little);
  }
  return read;
}
