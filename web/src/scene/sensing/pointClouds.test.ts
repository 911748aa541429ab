import { describe, expect, it } from "vitest";
import type { sensor_msgs_LaserScan, sensor_msgs_PointCloud2 } from "../../messages/generated.ts";
import { bytesOf, pointsOfCloud, pointsOfScan } from "./pointClouds.ts";

function scan(ranges: (number | null)[]): sensor_msgs_LaserScan {
  const angles = { angle_min: 0, angle_max: Math.PI, angle_increment: Math.PI / 2 };
  return { ...angles, range_min: 0.1, range_max: 30, ranges } as unknown as sensor_msgs_LaserScan;
}

function cloud(rows: number[][], bigEndian = false): sensor_msgs_PointCloud2 {
  const data = new Uint8Array(16 * rows.length);
  const view = new DataView(data.buffer);
  rows.forEach((row, i) => row.forEach((v, k) => view.setFloat32(16 * i + 4 * k, v, !bigEndian)));
  const fields = ["x", "y", "z"].map((name, k) => ({ name, offset: 4 * k, datatype: 7, count: 1 }));
  const size = { height: 1, width: rows.length, point_step: 16, row_step: 16 * rows.length };
  return { ...size, fields, is_bigendian: bigEndian, data } as unknown as sensor_msgs_PointCloud2;
}

describe("returns", () => {
  it("of a scan lie along their beams; what is out of range is none", () => {
    const points = pointsOfScan(scan([2, 3, 40]), 100);
    expect(Array.from(points, (v) => Math.round(v * 1e6) / 1e6)).toEqual([2, 0, 0, 0, 3, 0]);
    expect(pointsOfScan(scan([null, NaN, 0.01, Infinity]), 100)).toHaveLength(0);
  });

  it("are thinned out where they are too many", () => {
    expect(pointsOfScan(scan(Array(1000).fill(1)), 100).length / 3).toBeLessThanOrEqual(100);
    expect(pointsOfCloud(cloud(Array(1000).fill([1, 2, 3])), 50).length / 3).toBeLessThanOrEqual(
      50,
    );
  });

  it("of a cloud are read in either order of bytes, and from base64", () => {
    for (const big of [false, true])
      expect([
        ...pointsOfCloud(
          cloud(
            [
              [1, 2, 3],
              [4, 5, NaN],
            ],
            big,
          ),
          9,
        ),
      ]).toEqual([1, 2, 3]);
    const made = cloud([[1, 2, 3]]);
    const text = btoa(String.fromCharCode(...bytesOf(made.data)));
    expect([...pointsOfCloud({ ...made, data: text }, 9)]).toEqual([1, 2, 3]);
  });

  it("of a cloud whose rows are padded are read row by row", () => {
    const data = new Uint8Array(3 * 40).fill(0x7f);
    const view = new DataView(data.buffer);
    const rows = [0, 1, 2].map((r) => [0, 1].map((c) => [10 * r + c, 2, 3]));
    rows.forEach((row, r) =>
      row.forEach((point, c) =>
        point.forEach((v, k) => view.setFloat32(40 * r + 16 * c + 4 * k, v, true)),
      ),
    );
    const padded = { ...cloud([]), data, height: 3, width: 2, row_step: 40 };
    expect([...pointsOfCloud(padded, 9)]).toEqual(rows.flat(2));
    // the last row may end without its padding, and a cut message in any row
    expect([...pointsOfCloud({ ...padded, data: data.slice(0, 112) }, 9)]).toEqual(rows.flat(2));
    const cut = { ...padded, data: data.slice(0, 40 + 20) };
    expect([...pointsOfCloud(cut, 9)]).toEqual(rows.flat(2).slice(0, 9));
    // a row_step of 0, as some publishers leave it, is that of rows without padding
    const made = cloud([
      [1, 2, 3],
      [4, 5, 6],
    ]);
    expect([...pointsOfCloud({ ...made, row_step: 0 }, 9)]).toEqual([1, 2, 3, 4, 5, 6]);
    expect(pointsOfCloud({ ...made, width: 0 }, 9)).toHaveLength(0);
  });

  it("of strange clouds are none", () => {
    const made = cloud([[1, 2, 3]]);
    expect(pointsOfCloud({ ...made, fields: [] }, 9)).toHaveLength(0);
    expect(pointsOfCloud({ ...made, point_step: 0 }, 9)).toHaveLength(0);
    expect(pointsOfCloud({ ...made, point_step: 4 }, 9)).toHaveLength(0);
    expect([...pointsOfCloud({ ...made, width: 1000 }, 9)]).toEqual([1, 2, 3]);
  });
});
