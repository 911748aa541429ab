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

/** Maximum number of segments of all trails together, and for each UAV of a small fleet. */
const SEGMENTS = 20_000;
const LONGEST = 400;
const FADE_S = 60;
/** Minimum length of a segment, while there are `LONGEST` for each UAV. */
const SHORTEST_M = 0.12;
/** A step as long as this was a leap and leaves no trail, m. */
const LEAP_M = 4;
const WIDTH_PX = 2;

/**
 * Where each UAV came from. All trails share one ring of segments, in the order of time: UAVs that
 * stand leave their part to the others, and what a frame adds goes to the graphics card in one piece.
 */
export class Trails implements Part {
  readonly object = new Group();
  private readonly lines = new SegmentLines(SEGMENTS, { fadeS: FADE_S });
  private version = -1;
  private epoch = -1;
  private capacity = SEGMENTS;
  private shortestM = SHORTEST_M;
  /** Of each UAV: end of its trail. */
  private ends = new Float64Array(0);
  /** Of each segment: its UAV; -1: none. */
  private readonly owners = new Int32Array(SEGMENTS).fill(-1);
  /** How many segments there have been. */
  private drawn = 0;
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
    const before = this.drawn;
    for (let i = 0; i < fleet.uavs.length; i++) this.grow(i, nowS);
    this.send(before);
    this.lines.update(moment, nowS);
  }

  /** How many segments the trail of a UAV has. */
  lengthOf(uav: string): number {
    const i = fleet.uavs.findIndex(({ name }) => name === uav);
    if (i < 0) return 0;
    return this.owners.reduce((count, owner) => count + Number(owner === i), 0);
  }

  dispose(): void {
    this.lines.dispose();
  }

  private restart(nowMs: number, epoch: number): void {
    this.epoch = epoch;
    const count = fleet.uavs.length;
    this.version = fleet.version;
    this.begunMs = nowMs;
    this.capacity = Math.min(SEGMENTS, LONGEST * count);
    // Trails of a crowd are coarser instead of much shorter.
    this.shortestM = SHORTEST_M * Math.sqrt(Math.max(1, (LONGEST * count) / SEGMENTS));
    this.ends = new Float64Array(3 * count).fill(NaN);
    this.owners.fill(-1);
    this.drawn = 0;
    this.lines.clear();
  }

  /** Drop the trail of one UAV; it begins again with its next position. */
  private forget(i: number): void {
    this.ends.fill(NaN, 3 * i, 3 * i + 3);
    for (let slot = this.owners.indexOf(i); slot >= 0; slot = this.owners.indexOf(i, slot + 1)) {
      this.owners[slot] = -1;
      this.lines.blank(slot, slot + 1);
    }
  }

  /** Have the segments drawn that came after the first `before`. */
  private send(before: number): void {
    const { drawn, capacity, lines } = this;
    if (drawn === before) return;
    const [from, to] = [before % capacity, drawn % capacity];
    if (drawn - before >= capacity) lines.send(0, capacity);
    else if (from < to) lines.send(from, to);
    else {
      lines.send(from, capacity);
      lines.send(0, to);
    }
    lines.count = Math.min(drawn, capacity);
  }

  private grow(i: number, nowS: number): void {
    const uav = fleet.uavs[i]!;
    const at = uav.row * POSE;
    if (at < 0) return;
    const { ends } = this;
    if (isRestarting(uav.name)) {
      this.forget(i);
      return;
    }
    const [x, y, z] = [shown.poses[at]!, shown.poses[at + 1]!, shown.poses[at + 2]!];
    const [ax, ay, az] = [ends[3 * i]!, ends[3 * i + 1]!, ends[3 * i + 2]!];
    const step = Math.hypot(x - ax, y - ay, z - az);
    if (step < this.shortestM) return;
    ends[3 * i] = x;
    ends[3 * i + 1] = y;
    ends[3 * i + 2] = z;
    if (!(step < LEAP_M)) return; // also the first position of all
    const slot = this.drawn++ % this.capacity;
    this.owners[slot] = i;
    this.lines.put(slot, ax, ay, az, x, y, z, WIDTH_PX, uav.colour, 0.85, nowS);
  }
}
