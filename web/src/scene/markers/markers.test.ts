import { describe, expect, it } from "vitest";
import type { visualization_msgs_Marker } from "../../messages/generated.ts";
import { addPieces, emptyPieces } from "./pieces.ts";
import { MarkerStore } from "./store.ts";

const MAP = [0, 0, 0, 0, 0, 0, 1] as const;

function marker(changes: object): visualization_msgs_Marker {
  return {
    header: { stamp: { sec: 0, nanosec: 0 }, frame_id: "map" },
    ns: "a",
    id: 1,
    type: 1,
    action: 0,
    pose: { position: { x: 1, y: 2, z: 3 }, orientation: { x: 0, y: 0, z: 0, w: 1 } },
    scale: { x: 1, y: 1, z: 1 },
    color: { r: 1, g: 0, b: 0, a: 1 },
    lifetime: { sec: 0, nanosec: 0 },
    points: [],
    colors: [],
    text: "",
    ...changes,
  } as unknown as visualization_msgs_Marker;
}

function pieces(changes: object) {
  const out = emptyPieces();
  addPieces(marker(changes), [...MAP], out);
  return out;
}

describe("marker store", () => {
  it("keeps by namespace and id, and forgets what is deleted", () => {
    const store = new MarkerStore();
    store.take("/m", [marker({}), marker({ id: 2 }), marker({ ns: "b" })], 0);
    store.take("/m", [marker({ id: 2, type: 2 })], 0);
    expect(store.kept.size).toBe(3);
    store.take("/m", [marker({ id: 2, action: 2 })], 0);
    expect(store.kept.size).toBe(2);
    store.take("/m", [marker({ ns: "", action: 3 })], 0);
    expect(store.kept.size).toBe(0);
  });

  it("ends lifetimes; none lasts for ever", () => {
    const store = new MarkerStore();
    store.take("/m", [marker({ lifetime: { sec: 2, nanosec: 0 } }), marker({ id: 2 })], 1000);
    store.expire(2999);
    expect(store.kept.size).toBe(2);
    store.expire(3001);
    expect([...store.kept.values()].map(({ marker }) => marker.id)).toEqual([2]);
  });

  it("leaves another topic's markers alone", () => {
    const store = new MarkerStore();
    store.take("/m", [marker({})], 0);
    store.take("/mm", [marker({})], 0);
    store.forget("/m ");
    expect([...store.kept.keys()]).toEqual(["/mm a 1"]);
  });
});

describe("pieces of markers", () => {
  const P = (x: number, y = 0, z = 0) => ({ x, y, z });

  it("are placed by the marker's pose", () => {
    const half = Math.SQRT1_2;
    const pose = { position: P(1, 2, 3), orientation: { x: 0, y: 0, z: half, w: half } };
    const { lines } = pieces({ type: 4, pose, points: [P(0), P(1), P(2)] });
    expect(lines).toHaveLength(2);
    expect(lines[0]!.to.map((v) => Math.round(v * 1e6) / 1e6)).toEqual([1, 3, 3]);
  });

  it("of a list are pairs, of a strip a chain", () => {
    const points = [P(0), P(1), P(2), P(3)];
    expect(pieces({ type: 5, points }).lines).toHaveLength(2);
    expect(pieces({ type: 4, points }).lines).toHaveLength(3);
    expect(pieces({ type: 6, points }).shapes).toHaveLength(4);
  });

  it("of an arrow reach from its first point to its second", () => {
    const { shapes } = pieces({
      type: 0,
      points: [P(0), P(0, 0, 2)],
      scale: { x: 0.1, y: 0.2, z: 0.5 },
    });
    const [shaft, head] = shapes;
    expect(shaft!.scale[2] + head!.scale[2]).toBeCloseTo(2, 9);
    expect(head!.pose.slice(0, 3).map((v) => Math.round(v * 1e6) / 1e6)).toEqual([1, 2, 4.75]);
  });

  it("take no orientation for none, and nothing that is no number", () => {
    const none = { position: P(0), orientation: { x: 0, y: 0, z: 0, w: 0 } };
    expect(pieces({ pose: none }).shapes[0]!.pose).toEqual([0, 0, 0, 0, 0, 0, 1]);
    const bad = { position: P(NaN), orientation: { x: 0, y: 0, z: 0, w: 1 } };
    expect(pieces({ pose: bad }).shapes).toHaveLength(0);
    expect(pieces({ type: 11, points: [P(0), P(1)] }).triangles).toHaveLength(0);
    expect(pieces({ type: 99 })).toEqual(emptyPieces());
  });
});
