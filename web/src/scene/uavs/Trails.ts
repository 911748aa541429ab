import { Group } from "three";
import { POSE } from "../../link/protocol.ts";
import { useEpoch } from "../../state/epoch.ts";
import { isRestarting } from "../../state/restarts.ts";
import { useView } from "../../state/view.ts";
import { SegmentLines } from "../lines/SegmentLines.ts";
import { debugging } from "../stage/debugging.ts";
import type { Moment, Part } from "../stage/part.ts";
import { shown } from "../stage/shown.ts";
import { fleet } from "./fleet.ts";

/** Most segments of all trails together, and of one UAV. */
const SEGMENTS = 20_000;
const LONGEST = 400;
const FADE_S = 60;
const SHORTEST_M = 0.12;
/** A step as long as this was a leap and leaves no trail, m. */
const LEAP_M = 4;
const WIDTH_PX = 2;

/** Where each UAV came from: a ring of segments each, all of them one draw call. */
export class Trails implements Part {
  readonly object = new Group();
  private readonly lines = new SegmentLines(SEGMENTS, { fadeS: FADE_S });
  private version = -1;
  private epoch = -1;
  private each = LONGEST;
  /** Of each UAV: end of its trail, and how many segments it has had. */
  private ends = new Float64Array(0);
  private counts = new Uint32Array(0);
  private begunMs = 0;

  constructor() {
    this.object.add(this.lines.object);
    debugging.trailLength = (uav) => this.lengthOf(uav);
  }

  update(moment: Moment): void {
    this.object.visible = useView.getState().show.trails;
    const { epoch } = useEpoch.getState();
    if (fleet.version !== this.version || epoch !== this.epoch) this.restart(moment.nowMs, epoch);
    const nowS = (moment.nowMs - this.begunMs) / 1000;
    const { uavs } = fleet;
    for (let i = 0; i < uavs.length; i++) this.grow(i, nowS);
    this.lines.update(moment, nowS);
  }

  /** How many segments the trail of a UAV has. */
  lengthOf(uav: string): number {
    const i = fleet.uavs.findIndex(({ name }) => name === uav);
    return Math.min(this.each, this.counts[i] ?? 0);
  }

  dispose(): void {
    this.lines.dispose();
  }

  private restart(nowMs: number, epoch: number): void {
    this.epoch = epoch;
    const count = fleet.uavs.length;
    this.version = fleet.version;
    this.begunMs = nowMs;
    this.each = Math.min(LONGEST, Math.floor(SEGMENTS / Math.max(1, count)));
    this.ends = new Float64Array(3 * count).fill(NaN);
    this.counts = new Uint32Array(count);
    this.lines.clear();
  }

  /** Drop the trail of one UAV; it begins anew with its next place. */
  private forget(i: number): void {
    const [from, to] = [i * this.each, i * this.each + Math.min(this.counts[i]!, this.each)];
    this.lines.blank(from, to);
    this.ends.fill(NaN, 3 * i, 3 * i + 3);
    this.counts[i] = 0;
  }

  private grow(i: number, nowS: number): void {
    const uav = fleet.uavs[i]!;
    const at = uav.row * POSE;
    if (at < 0) return;
    const { ends, each, counts, lines } = this;
    if (isRestarting(uav.name)) {
      this.forget(i);
      return;
    }
    const [x, y, z] = [shown.poses[at]!, shown.poses[at + 1]!, shown.poses[at + 2]!];
    const [ax, ay, az] = [ends[3 * i]!, ends[3 * i + 1]!, ends[3 * i + 2]!];
    const step = Math.hypot(x - ax, y - ay, z - az);
    if (step < SHORTEST_M) return;
    ends[3 * i] = x;
    ends[3 * i + 1] = y;
    ends[3 * i + 2] = z;
    if (!(step < LEAP_M)) return; // also the first place of all
    const slot = i * each + (counts[i]!++ % each);
    lines.put(slot, ax, ay, az, x, y, z, WIDTH_PX, uav.colour, 0.85, nowS);
    lines.send(slot, slot + 1);
    // Slots that nothing was put into yet are clear, and cost nothing.
    if (slot >= lines.count) lines.count = Math.min(SEGMENTS, (i + 1) * each);
  }
}
