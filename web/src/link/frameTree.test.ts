import { beforeEach, expect, it } from "vitest";
import type { Transforms } from "../lib/cdrTransforms.ts";
import { FrameTree, transformsOf } from "./frameTree.ts";

/** Transforms `parent > child` without rotation, by x. */
function along(positions: Record<string, number>): Transforms {
  const names = Object.keys(positions).map((name) => name.split(" > ") as [string, string]);
  const poses = Object.values(positions).flatMap((x) => [x, 0, 0, 0, 0, 0, 1]);
  return {
    stampS: 1,
    parents: names.map(([parent]) => parent),
    children: names.map(([, child]) => child),
    poses: Float64Array.from(poses),
  };
}

let tree: FrameTree;
beforeEach(() => (tree = new FrameTree()));

function positions(): Record<string, number> {
  const { names } = tree.names();
  const rows = tree.rows(names);
  return Object.fromEntries(names.map((name, i) => [name, rows[7 * i]!]));
}

it("frames are where their parents lead, in whichever order they came", () => {
  tree.fix(along({ "map > uav1/odom": 10 }));
  tree.move(along({ "/uav1/odom > uav1/base_link": 3, "uav1/base_link > uav1/laser": 0.5 }));
  expect(positions()).toEqual({ "uav1/base_link": 13, "uav1/laser": 13.5 });
  const { version } = tree;
  tree.move(along({ "uav1/odom > uav1/base_link": 4 }));
  expect(positions()).toEqual({ "uav1/base_link": 14, "uav1/laser": 14.5 });
  expect(tree.version).toBe(version);
});

it("the truth wins over estimates, and what it no longer names is gone", () => {
  tree.fix(along({ "map > uav1/odom": 10 }));
  tree.move(along({ "uav1/odom > uav1/base_link": 3, "uav1/base_link > uav1/laser": 0.5 }));
  tree.moveTruly(along({ "map > uav1/base_link": 1, "map > uav2/base_link": 2 }));
  expect(positions()).toEqual({ "uav1/base_link": 1, "uav2/base_link": 2, "uav1/laser": 1.5 });
  const { version } = tree;
  tree.moveTruly(along({ "map > uav1/base_link": 5, "map > uav2/base_link": 6 }));
  expect(positions()).toEqual({ "uav1/base_link": 5, "uav2/base_link": 6, "uav1/laser": 5.5 });
  expect(tree.version).toBe(version);
  tree.moveTruly(along({ "map > uav2/base_link": 7 }));
  expect(tree.version).toBeGreaterThan(version);
  expect(positions()).toMatchObject({ "uav2/base_link": 7 });
  expect(positions()).not.toHaveProperty("uav1/base_link");
});

it("the same number of other frames are other frames", () => {
  tree.moveTruly(along({ "map > a": 1, "map > b": 2 }));
  const { version } = tree;
  tree.moveTruly(along({ "map > b": 3, "map > c": 4 }));
  expect(tree.version).toBeGreaterThan(version);
  expect(positions()).toEqual({ b: 3, c: 4 });
});

it("transforms that come as objects are read alike", () => {
  const header = { frame_id: "map", stamp: { sec: 2, nanosec: 5e8 } };
  const transform = { translation: { x: 1, y: 2, z: 3 }, rotation: { x: 0, y: 0, z: 0, w: 1 } };
  expect(transformsOf([{ header, child_frame_id: "robot", transform }])).toEqual({
    stampS: 2.5,
    parents: ["map"],
    children: ["robot"],
    poses: Float64Array.of(1, 2, 3, 0, 0, 0, 1),
  });
  expect(transformsOf([]).stampS).toBeNaN();
});
