// What moves on the map: UAVs, where they came from and go, the view.

import { eulerOf } from "../../lib/pose.ts";
import { barLength, pixelOf, type MapView, type Size } from "../../lib/mapProjection.ts";
import type { Frames } from "../../link/frames.ts";
import { POSE } from "../../link/protocol.ts";
import { baseFrame } from "../../state/vehicles.ts";
import { eye } from "../../state/eye.ts";

export interface Traveller {
  name: string;
  crashed: boolean;
  /** Left out: that of all UAVs. */
  colour?: string;
}

const CONE_PX = 70;
const BAR_PX = 90;
/** Room of a name above its UAV. */
const NAME_ROOM_PX = 28;
const RED = "#f03e3e";
const EYE = "rgba(34, 139, 230, 0.28)";

/** Corners of the arrow of a UAV that heads right, px. */
const ARROW = [7, 0, -5, 4.5, -3, 0, -5, -4.5] as const;
/** Radius of the ring around a UAV of the selected group, px. */
const GROUP_PX = 8;

function addArrow(path: Path2D, px: number, py: number, yaw: number): void {
  const [c, s] = [Math.cos(yaw), -Math.sin(yaw)];
  for (let i = 0; i < ARROW.length; i += 2) {
    const [x, y] = [ARROW[i]!, ARROW[i + 1]!];
    const [ax, ay] = [px + c * x - s * y, py + s * x + c * y];
    if (i === 0) path.moveTo(ax, ay);
    else path.lineTo(ax, ay);
  }
  path.closePath();
}

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

  /** All UAVs with their heading, the selected one circled in red, those of its group too. */
  uavs(
    frames: Frames,
    travellers: readonly Traveller[],
    selected: string,
    group: ReadonlySet<string>,
  ): void {
    // Arrows of one colour are one path: a thousand paths of their own take longer than the rest.
    const arrows = new Map<string, Path2D>();
    const dots = new Path2D();
    let circled: [number, number] | null = null;
    for (const uav of travellers) {
      const row = frames.row(baseFrame(uav.name));
      if (row < 0 || frames.now.length < (row + 1) * POSE) continue;
      const pose = frames.now.subarray(row * POSE, (row + 1) * POSE);
      if (Number.isNaN(pose[0]!)) continue;
      const [px, py] = this.at(pose[0]!, pose[1]!);
      const { yaw } = eulerOf(pose[3]!, pose[4]!, pose[5]!, pose[6]!);
      const colour = this.colourOf(uav);
      let path = arrows.get(colour);
      if (path === undefined) arrows.set(colour, (path = new Path2D()));
      addArrow(path, px, py, yaw);
      if (group.has(uav.name)) {
        dots.moveTo(px + GROUP_PX, py);
        dots.arc(px, py, GROUP_PX, 0, 2 * Math.PI);
      }
      if (uav.name === selected) circled = [px, py];
    }
    this.paint(arrows, dots);
    if (circled !== null) this.circle(...circled, selected);
  }

  private colourOf({ crashed, colour }: Traveller): string {
    if (crashed) return "#868e96";
    return colour ?? (this.dark ? "#66d9e8" : "#0b7285");
  }

  private paint(arrows: ReadonlyMap<string, Path2D>, dots: Path2D): void {
    const { context } = this;
    context.strokeStyle = this.dark ? "#10131a" : "#ffffff";
    context.lineWidth = 1;
    for (const [colour, path] of arrows) {
      context.fillStyle = colour;
      context.fill(path);
      context.stroke(path);
    }
    context.strokeStyle = RED;
    context.lineWidth = 1.5;
    context.stroke(dots);
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
    const maxPx = this.size.width - 8;
    const halfPx = Math.min(maxPx, context.measureText(name).width) / 2 + 4;
    const x = Math.max(halfPx, Math.min(px, this.size.width - halfPx));
    context.strokeText(name, x, y, maxPx);
    context.fillText(name, x, y, maxPx);
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
