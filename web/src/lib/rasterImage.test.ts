import { describe, expect, it } from "vitest";
import { labelColour, turbo } from "./colourMaps.ts";
import { pixelsOf, type RawImage } from "./rasterImage.ts";

function image(encoding: string, data: Uint8Array, width = 2, bytes = 1, height = 1): RawImage {
  return { width, height, encoding, is_bigendian: 0, step: width * bytes, data };
}

describe("turbo", () => {
  it("goes from blue over green to red", () => {
    const [low, middle, high] = [turbo(0.1), turbo(0.5), turbo(0.9)];
    expect(Math.max(...low)).toBe(low[2]);
    expect(Math.max(...middle)).toBe(middle[1]);
    expect(Math.max(...high)).toBe(high[0]);
    expect(turbo(-3)).toEqual(turbo(0));
  });

  it("is near the published table's colour in the middle, as near as its polynomial", () => {
    turbo(128 / 255).forEach((channel, i) =>
      expect(Math.abs(channel - [164, 252, 60][i]!)).toBeLessThanOrEqual(24),
    );
  });
});

describe("images", () => {
  it("have their channels in order, and rows of any length", () => {
    const padded = { ...image("bgr8", Uint8Array.of(1, 2, 3, 0, 4, 5, 6, 0), 1, 3, 2), step: 4 };
    expect(Array.from(pixelsOf(padded).rgba)).toEqual([3, 2, 1, 255, 6, 5, 4, 255]);
    expect(Array.from(pixelsOf(image("rgb8", Uint8Array.of(1, 2, 3), 1, 3)).rgba)).toEqual([
      1, 2, 3, 255,
    ]);
    expect(Array.from(pixelsOf(image("mono8", Uint8Array.of(9), 1)).rgba)).toEqual([9, 9, 9, 255]);
  });

  it("of depth report their range, near is red, and what is unknown is grey", () => {
    const depths = new Uint8Array(new Float32Array([2, NaN, 10, Infinity]).buffer);
    const { rgba, range } = pixelsOf(image("32FC1", depths, 4, 4));
    expect(range).toEqual([2, 10]);
    expect(Array.from(rgba.slice(0, 3))).toEqual(turbo(1));
    expect(Array.from(rgba.slice(8, 11))).toEqual(turbo(0));
    expect(rgba.slice(4, 8)).toEqual(rgba.slice(12, 16));
  });

  it("of depth in millimetres are read with either end first", () => {
    const data = new Uint8Array(4);
    new DataView(data.buffer).setUint16(0, 1500, false);
    const big = { ...image("16UC1", data, 2, 2), is_bigendian: 1 };
    expect(pixelsOf(big).range).toEqual([1.5, 1.5]);
  });

  it("of labels give each its colour", () => {
    const labels = new Uint8Array(new Int32Array([7, 8]).buffer);
    const { rgba } = pixelsOf(image("32SC1", labels, 2, 4), "/uav1/front/labels/instance");
    expect(Array.from(rgba.slice(0, 3))).toEqual(labelColour(7));
    expect(labelColour(7)).not.toEqual(labelColour(8));
    const materials = pixelsOf(image("mono8", Uint8Array.of(3, 0)), "/uav1/front/labels/material");
    expect(Array.from(materials.rgba.slice(0, 3))).toEqual(labelColour(3));
  });

  it("that are not understood say why", () => {
    expect(() => pixelsOf(image("bayer_rggb8", new Uint8Array(2)))).toThrow("bayer_rggb8");
    expect(() => pixelsOf(image("rgb8", new Uint8Array(2), 2, 3))).toThrow("too short");
  });
});
