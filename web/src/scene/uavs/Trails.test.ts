import type { InstancedBufferGeometry, Mesh } from "three";
import { beforeEach, expect, it, vi } from "vitest";

type Listener = (received: { message: unknown }) => void;
const listeners = new Map<string, Listener>();
const link = {
  frames: { stampS: 0, row: () => 0 },
  subscribe: (topic: string, _type: string, listener: Listener) => listeners.set(topic, listener),
  watch: () => 0,
};
vi.mock("../../link/link.ts", () => ({ link }));

const { followRestarts } = await import("../../state/restarts.ts");
const { useEpoch } = await import("../../state/epoch.ts");
const { shown } = await import("../stage/shown.ts");
const { fleet } = await import("./fleet.ts");
const { Trails } = await import("./Trails.ts");
type Moment = Parameters<InstanceType<typeof Trails>["update"]>[0];

followRestarts();
const clock = vi.spyOn(performance, "now");
let nowMs = 0;

/** Segments that are drawn, by their UAV's colour. */
function drawnReds(trails: InstanceType<typeof Trails>): number {
  const mesh = trails.object.children[0] as Mesh<InstancedBufferGeometry>;
  const tint = mesh.geometry.getAttribute("tint");
  const shown = Array.from({ length: mesh.geometry.instanceCount }, (_, i) => i);
  return shown.filter((i) => tint.getX(i) === 1 && tint.getW(i) > 0).length;
}

/** Two UAVs fly along x, seen in a frame each tenth of a second. */
function fly(trails: InstanceType<typeof Trails>, from: number, to: number): void {
  for (let x = from; x < to; x += 0.5) {
    shown.poses.set([x, 0, 2], 0);
    shown.poses.set([x, 9, 2], 7);
    nowMs += 100;
    link.frames.stampS += 0.1;
    clock.mockReturnValue(nowMs);
    trails.update({ nowMs, width: 100, height: 100 } as Moment);
  }
}

beforeEach(() => {
  const uav = { airframe: "", mode: "", crashed: false, airborne: true, rotorSpeed: 0 };
  fleet.uavs = [
    { ...uav, name: "uav1", row: 0, colour: [1, 0, 0] },
    { ...uav, name: "uav2", row: 1, colour: [0, 1, 0] },
  ];
  fleet.version++;
  shown.poses = new Float64Array(14);
});

it("the trail of a UAV that is put back to its start begins again, that of another goes on", () => {
  const trails = new Trails();
  fly(trails, 0, 10);
  expect([trails.lengthOf("uav1"), trails.lengthOf("uav2")]).toEqual([19, 19]);
  const stamp = { sec: 0, nanosec: Math.round(link.frames.stampS * 1e9) };
  const command = { kind: "call", name: "/volery/reset_uav", content: '{"name": "uav1"}' };
  listeners.get("/volery/log")!({ message: { ...command, stamp, client: "" } });
  fly(trails, 10, 12.5); // in the half second that the scene needs there is no trail
  expect([trails.lengthOf("uav1"), trails.lengthOf("uav2")]).toEqual([0, 24]);
  expect(drawnReds(trails)).toBe(0);
  fly(trails, 12.5, 20);
  expect(trails.lengthOf("uav2")).toBe(39);
  expect(trails.lengthOf("uav1")).toBeGreaterThan(10);
  expect(trails.lengthOf("uav1")).toBeLessThan(16);
});

it("all trails begin again with an epoch", () => {
  const trails = new Trails();
  fly(trails, 0, 10);
  useEpoch.setState({ epoch: 7 });
  fly(trails, 0, 1);
  expect(trails.lengthOf("uav1")).toBe(1);
});

it("trails share their segments: a UAV that flies has those of one that stands", () => {
  const trails = new Trails();
  fly(trails, 0, 600); // two in step
  expect([trails.lengthOf("uav1"), trails.lengthOf("uav2")]).toEqual([400, 400]);
  for (let x = 600; x < 750; x += 0.5) {
    shown.poses.set([x, 0, 2], 0);
    trails.update({ nowMs: (nowMs += 100), width: 100, height: 100 } as Moment);
  }
  expect([trails.lengthOf("uav1"), trails.lengthOf("uav2")]).toEqual([550, 250]);
  expect(drawnReds(trails)).toBe(550);
});

it("segments of a crowd are longer, so that its trails stay long", () => {
  const [first] = fleet.uavs;
  fleet.uavs = Array.from({ length: 1000 }, (_, row) => ({
    ...first!,
    name: `uav${row + 1}`,
    row,
  }));
  fleet.version++;
  shown.poses = new Float64Array(7000);
  const trails = new Trails();
  for (let frame = 0; frame < 400; frame++) {
    for (let row = 0; row < 1000; row++) shown.poses[7 * row] = 0.15 * frame;
    trails.update({ nowMs: (nowMs += 33), width: 100, height: 100 } as Moment);
  }
  expect(trails.lengthOf("uav1")).toBe(20);
  const mesh = trails.object.children[0] as Mesh<InstancedBufferGeometry>;
  const { start, end } = mesh.geometry.attributes;
  expect(end!.getX(0) - start!.getX(0)).toBeCloseTo(0.6, 4);
  expect(trails.lengthOf("uav1000")).toBe(20);
});
