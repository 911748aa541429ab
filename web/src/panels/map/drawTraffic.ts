// What moves on the map: UAVs, ways they came and go, the view.

import { eulerOf } from "../../lib/pose.ts";
import { barLength, pixelOf, type MapView, type Size } from "../../lib/mapProjection.ts";
import type { Frames } from "../../link/frames.ts";
import { POSE } from "../../link/protocol.ts";
import { baseFrame } from "../../state/vehicles.ts";
import { eye } from "../../state/eye.ts";

export interface Traveller {
  name: string;
  crashed: boolean;
}

const CONE_PX = 70;
const BAR_PX = 90;
/** Room of a name above its UAV. */
const NAME_ROOM_PX = 28;
const RED = "#f03e3e";
const EYE = "rgba(34, 139, 230, 0.28)";

/** Draws on one canvas with one view. */
export class Pen {
  constructor(
    private readonly context: CanvasRenderingContext2D,
    private readonly view: MapView,
    private readonly size: Size,
    private readonly dark: boolean,
  ) {}

  private at(x: number, y: number): [number, number] {
    return pixelOf(this.view, this.size, x, y);
  }

  /** Where one looks from, and what one sees. */
  cone(): void {
    if (eye.width === 0) return;
    const { context } = this;
    const [x, y] = this.at(eye.x, eye.y);
    const half = Math.min(eye.width, 3) / 2;
    context.fillStyle = EYE;
    context.beginPath();
    context.moveTo(x, y);
    context.arc(x, y, CONE_PX, -eye.heading - half, -eye.heading + half);
    context.fill();
  }

  /** Points x y of the map in turn. */
  line(points: ArrayLike<number>, colour: string, dash: number[] = []): void {
    const { context } = this;
    context.strokeStyle = colour;
    context.lineWidth = 2;
    context.setLineDash(dash);
    context.beginPath();
    for (let i = 0; i + 2 <= points.length; i += 2) {
      context.lineTo(...this.at(points[i]!, points[i + 1]!));
    }
    context.stroke();
    context.setLineDash([]);
  }

  cross(x: number, y: number): void {
    const { context } = this;
    const [px, py] = this.at(x, y);
    context.strokeStyle = RED;
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(px - 5, py - 5);
    context.lineTo(px + 5, py + 5);
    context.moveTo(px - 5, py + 5);
    context.lineTo(px + 5, py - 5);
    context.stroke();
  }

  /** All UAVs with their heading, the selected one circled in red. */
  uavs(frames: Frames, travellers: readonly Traveller[], selected: string): void {
    for (const uav of travellers) {
      const row = frames.row(baseFrame(uav.name));
      if (row < 0 || frames.now.length < (row + 1) * POSE) continue;
      const pose = frames.now.subarray(row * POSE, (row + 1) * POSE);
      if (Number.isNaN(pose[0]!)) continue;
      const [px, py] = this.at(pose[0]!, pose[1]!);
      const { yaw } = eulerOf(pose[3]!, pose[4]!, pose[5]!, pose[6]!);
      this.arrow(px, py, yaw, uav.crashed);
      if (uav.name === selected) this.circle(px, py, uav.name);
    }
  }

  private arrow(px: number, py: number, yaw: number, crashed: boolean): void {
    const { context } = this;
    context.save();
    context.translate(px, py);
    context.rotate(-yaw);
    context.fillStyle = crashed ? "#868e96" : this.dark ? "#66d9e8" : "#0b7285";
    context.strokeStyle = this.dark ? "#10131a" : "#ffffff";
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(7, 0);
    context.lineTo(-5, 4.5);
    context.lineTo(-3, 0);
    context.lineTo(-5, -4.5);
    context.closePath();
    context.fill();
    context.stroke();
    context.restore();
  }

  private circle(px: number, py: number, name: string): void {
    const { context } = this;
    context.strokeStyle = RED;
    context.lineWidth = 2.5;
    context.beginPath();
    context.arc(px, py, 12, 0, 2 * Math.PI);
    context.stroke();
    context.font = "600 11px system-ui, sans-serif";
    context.textAlign = "center";
    context.lineWidth = 3;
    context.strokeStyle = this.dark ? "#10131a" : "#ffffff";
    context.fillStyle = this.dark ? "#f8f9fa" : "#212529";
    const y = py < NAME_ROOM_PX ? py + NAME_ROOM_PX : py - 17; // inside the window also at its edge
    const mostPx = this.size.width - 8;
    const halfPx = Math.min(mostPx, context.measureText(name).width) / 2 + 4;
    const x = Math.max(halfPx, Math.min(px, this.size.width - halfPx));
    context.strokeText(name, x, y, mostPx);
    context.fillText(name, x, y, mostPx);
  }

  /** How long a metre is. */
  bar(): void {
    const { context } = this;
    const metres = barLength(this.view.scale, BAR_PX);
    const [left, bottom] = [10, this.size.height - 10];
    const right = left + metres * this.view.scale;
    const ink = this.dark ? "#dee2e6" : "#343a40";
    context.strokeStyle = context.fillStyle = ink;
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(left, bottom - 5);
    context.lineTo(left, bottom);
    context.lineTo(right, bottom);
    context.lineTo(right, bottom - 5);
    context.stroke();
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "left";
    context.fillText(`${metres} m`, left + 5, bottom - 4);
  }
}
