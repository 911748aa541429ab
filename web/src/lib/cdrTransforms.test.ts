import { expect, it } from "vitest";
import { readTransforms } from "./cdrTransforms.ts";

/** map to uav1/odom and uav1/odom to uav1/bäse_link at 12.25 s, as rosbags encodes them. */
const BYTES =
  "00010000020000000c00000080b2e60e040000006d6170000a000000756176312f6f646f6d00000000000000" +
  "000000000000f03f000000000000004000000000000008400000000000000000000000000000000000000000" +
  "00000000000000000000f03f0c00000080b2e60e0a000000756176312f6f646f6d0000001000000075617631" +
  "2f62c3a473655f6c696e6b0000000000000000000000e0bf0000000000000000000000000000f87f00000000" +
  "000000000000000000000000000000000000f03f0000000000000000";

function bytesOf(hex: string): Uint8Array {
  return Uint8Array.from(hex.match(/../g)!, (byte) => parseInt(byte, 16));
}

it("reads the transforms of a message", () => {
  const { stampS, parents, children, poses } = readTransforms(bytesOf(BYTES));
  expect(stampS).toBe(12.25);
  expect(parents).toEqual(["map", "uav1/odom"]);
  expect(children).toEqual(["uav1/odom", "uav1/bäse_link"]);
  expect([...poses]).toEqual([1, 2, 3, 0, 0, 0, 1, -0.5, 0, NaN, 0, 0, 1, 0]);
});

it("reads them wherever they are in a buffer", () => {
  const apart = new Uint8Array(3 + BYTES.length / 2);
  apart.set(bytesOf(BYTES), 3);
  expect(readTransforms(apart.subarray(3))).toEqual(readTransforms(bytesOf(BYTES)));
});

it("a message without transforms has no stamp", () => {
  const none = readTransforms(bytesOf("0001000000000000"));
  expect(none).toEqual({ stampS: NaN, parents: [], children: [], poses: new Float64Array() });
});

it("a message that is cut off cannot be read", () => {
  expect(() => readTransforms(bytesOf(BYTES.slice(0, -8)))).toThrow(RangeError);
});
