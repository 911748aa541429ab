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
const MOST_WRECKS = 32;
const SEGMENTS = (MOST_WRECKS + 1) * (SIDES + 2);

/** A ring around the selected UAV and its line to the ground; red ones where a UAV has crashed. */
export class Marks implements Part {
  readonly object = new Group();
  private readonly lines = new SegmentLines(SEGMENTS, { above: true });
  private count = 0;

  constructor() {
    this.object.add(this.lines.object);
  }

  update(moment: Moment): void {
    const { selected } = useVehicles.getState();
    const onboard = useView.getState().name === "onboard";
    this.count = 0;
    let wrecks = 0;
    for (const uav of fleet.uavs) {
      const isSelected = uav.name === selected;
      if (isSelected && onboard && !uav.crashed) continue; // nobody sees the ring he sits in
      if (!isSelected && !(uav.crashed && wrecks++ < MOST_WRECKS)) continue;
      this.mark(uav, uav.crashed ? CRASHED : SELECTED, isSelected);
    }
    this.lines.count = this.count;
    this.lines.send(0, this.count);
    this.lines.update(moment);
  }

  dispose(): void {
    this.lines.dispose();
  }

  private mark({ row, airframe }: ShownUav, colour: readonly number[], stem: boolean): void {
    const at = row * POSE;
    if (at < 0 || !Number.isFinite(shown.poses[at])) return;
    const [x, y, z] = [shown.poses[at]!, shown.poses[at + 1]!, shown.poses[at + 2]!];
    const { rotors, rotorRadius } = shapeOf(airframe);
    const radius = 1.25 * (rotorRadius + Math.hypot(rotors[0]![0]!, rotors[0]![1]!));
    const ground = currentWorld.ground.heightAt(x, y) + 0.02;
    let [ax, ay] = [x + radius, y];
    for (let i = 1; i <= SIDES; i++) {
      const turn = (2 * Math.PI * i) / SIDES;
      const [bx, by] = [x + radius * Math.cos(turn), y + radius * Math.sin(turn)];
      this.lines.put(this.count++, ax, ay, z, bx, by, z, 2, colour, 0.9);
      [ax, ay] = [bx, by];
    }
    if (!stem || z - ground < radius) return;
    this.lines.put(this.count++, x, y, z, x, y, ground, 1, colour, 0.45);
    this.lines.put(
      this.count++,
      x - 0.3 * radius,
      y,
      ground,
      x + 0.3 * radius,
      y,
      ground,
      2,
      colour,
      0.8,
    );
  }
}
