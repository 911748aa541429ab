import { Group } from "three";
import { POSE } from "../../link/protocol.ts";
import { useVehicles } from "../../state/vehicles.ts";
import { useView } from "../../state/view.ts";
import { SegmentLines } from "../lines/SegmentLines.ts";
import type { Moment, Part } from "../stage/part.ts";
import { shown } from "../stage/shown.ts";
import { currentWorld } from "../world/currentWorld.ts";
import { shapeOf } from "./airframeGeometry.ts";
import { CRASHED, SELECTED } from "./colours.ts";
import { fleet, type ShownUav } from "./fleet.ts";

const SIDES = 28;
/** Rings of a group are coarser: there may be hundreds. */
const GROUP_SIDES = 8;
const MAX_WRECKS = 32;
const MAX_GROUP = 2048;
const SEGMENTS = (MAX_WRECKS + 1) * (SIDES + 2) + MAX_GROUP * GROUP_SIDES;

/**
 * A ring around each selected UAV, and a line to the ground below the one that the Inspector shows;
 * red rings where a UAV has crashed.
 */
export class Marks implements Part {
  readonly object = new Group();
  private readonly lines = new SegmentLines(SEGMENTS, { above: true });
  private count = 0;

  constructor() {
    this.object.add(this.lines.object);
  }

  update(moment: Moment): void {
    const { selected, group } = useVehicles.getState();
    const onboard = useView.getState().name === "onboard";
    this.count = 0;
    let wrecks = 0;
    for (const uav of fleet.uavs) {
      const isSelected = uav.name === selected;
      if (isSelected && onboard && !uav.crashed) continue; // from within, the ring is not drawn
      if (!isSelected && !(uav.crashed && wrecks++ < MAX_WRECKS)) continue;
      this.mark(uav, uav.crashed ? CRASHED : SELECTED, isSelected);
    }
    for (const name of group.slice(0, MAX_GROUP)) {
      const uav = name === selected ? undefined : fleet.named(name);
      if (uav !== undefined) this.ring(uav, GROUP_SIDES, SELECTED);
    }
    this.lines.count = this.count;
    this.lines.send(0, this.count);
    this.lines.update(moment);
  }

  dispose(): void {
    this.lines.dispose();
  }

  private mark(uav: ShownUav, colour: readonly number[], stem: boolean): void {
    const radius = this.ring(uav, SIDES, colour);
    if (!stem || Number.isNaN(radius)) return;
    const [x, y, z] = shown.poses.subarray(uav.row * POSE) as unknown as [number, number, number];
    const ground = currentWorld.ground.heightAt(x, y) + 0.02;
    if (z - ground < radius) return;
    const arm = 0.3 * radius;
    this.lines.put(this.count++, x, y, z, x, y, ground, 1, colour, 0.45);
    this.lines.put(this.count++, x - arm, y, ground, x + arm, y, ground, 2, colour, 0.8);
  }

  /** Returns the radius, m; NaN: it is not known where the UAV is. */
  private ring({ row, airframe }: ShownUav, sides: number, colour: readonly number[]): number {
    const at = row * POSE;
    if (at < 0 || !Number.isFinite(shown.poses[at])) return NaN;
    const [x, y, z] = [shown.poses[at]!, shown.poses[at + 1]!, shown.poses[at + 2]!];
    const { rotors, rotorRadius } = shapeOf(airframe);
    const radius = 1.25 * (rotorRadius + Math.hypot(rotors[0]![0]!, rotors[0]![1]!));
    let [ax, ay] = [x + radius, y];
    for (let i = 1; i <= sides; i++) {
      const turn = (2 * Math.PI * i) / sides;
      const [bx, by] = [x + radius * Math.cos(turn), y + radius * Math.sin(turn)];
      this.lines.put(this.count++, ax, ay, z, bx, by, z, 2, colour, 0.9);
      [ax, ay] = [bx, by];
    }
    return radius;
  }
}
