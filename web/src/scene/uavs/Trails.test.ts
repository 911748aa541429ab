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

it("the trail of a UAV that is put back to its start begins anew, that of another goes on", () => {
  const trails = new Trails();
  fly(trails, 0, 10);
  expect([trails.lengthOf("uav1"), trails.lengthOf("uav2")]).toEqual([19, 19]);
  const stamp = { sec: 0, nanosec: Math.round(link.frames.stampS * 1e9) };
  const command = { kind: "call", name: "/volery/reset_uav", content: '{"name": "uav1"}' };
  listeners.get("/volery/log")!({ message: { ...command, stamp, client: "" } });
  fly(trails, 10, 12.5); // in the half second that the picture needs there is no trail
  expect([trails.lengthOf("uav1"), trails.lengthOf("uav2")]).toEqual([0, 24]);
  fly(trails, 12.5, 20);
  expect(trails.lengthOf("uav2")).toBe(39);
  expect(trails.lengthOf("uav1")).toBeGreaterThan(10);
  expect(trails.lengthOf("uav1")).toBeLessThan(16);
});

it("all trails begin anew with an epoch", () => {
  const trails = new Trails();
  fly(trails, 0, 10);
  useEpoch.setState({ epoch: 7 });
  fly(trails, 0, 1);
  expect(trails.lengthOf("uav1")).toBe(1);
});
